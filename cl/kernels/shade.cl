/* From: SHADE
   To: INTERSECT (the path goes on) or GENERATE (it ended), or before that SHADOW (next-event estimation);
   MEDIUM or SHADOW (a walk that needed another wave)
   Reads: event, ray, hit, beta, what it is inside of, media, surfaces, emitters.
   Writes: radiance, beta, the next ray, its bounce and what it is inside of; the shadow ray; first hits, energy cut. */
#include "stages/shade.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void shade_kernel(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
    const uint count = *queue_counter(&scene, group, QUEUE_SHADE);
    __global const uint *slots = queue_entries(&scene, group, QUEUE_SHADE);
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE)
        shade(&scene, group, slots[i]);
    queue_clear(&scene, group, QUEUE_SHADE);
}
