/* What walks counted is booked on the path, or on its slot. */
#ifndef CLVOL_PATH_TALLY_H
#define CLVOL_PATH_TALLY_H
#include "core/scene.h"
#include "tracking/tally.h"

INLINE void record_tally(const Scene *scene, uint slot, Tally tally)
{
    set_path_tentative(scene, slot, path_tentative(scene, slot) + tally.tentative);
    set_path_real(scene, slot, path_real(scene, slot) + tally.real);
    set_path_lookups(scene, slot, path_lookups(scene, slot) + tally.lookups);
    set_path_cells(scene, slot, path_cells(scene, slot) + tally.cells);
    if (tally.violations > 0)
        set_path_violations(scene, slot, path_violations(scene, slot) + tally.violations);
    if (tally.exhausted > 0)
        set_path_exhausted(scene, slot, path_exhausted(scene, slot) + tally.exhausted);
}

/* What a stage's budget counts (STAGE_STEPS). */
INLINE uint steps_of(const Tally *tally) { return tally->tentative + tally->cells + tally->lookups; }

#endif
