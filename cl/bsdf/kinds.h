/* Which kind of BSDF a material is, and what follows from it (clvol/layout/bsdfs.py). */
#ifndef CLVOL_BSDF_KINDS_H
#define CLVOL_BSDF_KINDS_H
#include "core/math.h"
#include "core/shared.h"
#include CLVOL_BSDFS_HEADER

/* Without a look where the scene has one kind only. */
#define IS_BSDF(material, name) (CLVOL_BSDF_##name && (BSDF_KINDS == 1 || (material)->kind == MATERIAL_##name))

/* Only delta lobes: no light can be sampled for it. */
INLINE bool material_is_smooth(__global const Material *material) { return IS_SMOOTH(material); }

/* Takes wi and wo on either side as they are; others are seen from +z alone. */
INLINE bool material_transmits(__global const Material *material) { return IS_TRANSMISSIVE(material); }

#endif
