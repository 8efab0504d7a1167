/* A work-item's paths one after the other. */
#include "kernels/steps.h"
#include "path/transitions.h"

INLINE void handle_paths(const Scene *scene, uint group, __global const uint *slots, uint count)
{
#ifdef STAGE_STANDS_BY
    uint steps = 0;
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE) {
        if (steps < STAGE_STEPS)
            steps += STAGE(scene, group, slots[i]);
        else
            to_shade(scene, group, slots[i], STAGE_STANDS_BY);
    }
#else
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE)
        STAGE(scene, group, slots[i]);
#endif
}
