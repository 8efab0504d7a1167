/* Which kind of phase function a lobe is (PHASE in clvol/layout/records.py). */
#ifndef CLVOL_PHASE_KINDS_H
#define CLVOL_PHASE_KINDS_H
#include "core/shared.h"
#include CLVOL_PHASES_HEADER

/* Without a look where the scene has one kind only. */
#define IS_PHASE(lobe, name) (CLVOL_PHASE_##name && (PHASE_KINDS == 1 || (lobe)->kind == PHASE_##name))

#endif
