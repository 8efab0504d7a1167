/* From: SHADOW
   To: where the path goes on (INTERSECT or GENERATE), or SHADE (a walk that needs another wave)
   Reads: shadow ray, what it is inside of, its light, media, majorants, volumes, surfaces.
   Writes: radiance, counts. */
#include "stages/shadow_transmittance.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void shadow_transmittance_kernel(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
    const uint count = *queue_counter(&scene, group, QUEUE_SHADOW);
    __global const uint *slots = queue_entries(&scene, group, QUEUE_SHADOW);
    uint steps = 0;
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE) {
        if (steps < STAGE_STEPS)
            steps += shadow_transmittance(&scene, group, slots[i]);
        else
            stand_by(&scene, group, slots[i], EVENT_SHADOW);
    }
    queue_clear(&scene, group, QUEUE_SHADOW);
}
