/* From: SHADOW
   To: none
   Reads: shadow ray, what it is inside of, its light, media, majorants, volumes, surfaces.
   Writes: radiance, counts. */
#include "stages/shadow_transmittance.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void shadow_transmittance_kernel(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
    const uint count = *queue_counter(&scene, group, QUEUE_SHADOW);
    __global const uint *slots = queue_entries(&scene, group, QUEUE_SHADOW);
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE)
        shadow_transmittance(&scene, group, slots[i]);
    queue_clear(&scene, group, QUEUE_SHADOW);
}
