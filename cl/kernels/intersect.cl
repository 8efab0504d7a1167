/* From: INTERSECT
   To: MEDIUM (a medium lies ahead, before any surface), SHADE (a surface, or escape)
   Reads: ray, the media it is inside of, media bounds, surfaces.
   Writes: event, hit, what the camera is inside of; for a lone medium its interval, and the ray moved there. */
#include "stages/intersect.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void intersect_kernel(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
    const uint count = *queue_counter(&scene, group, QUEUE_INTERSECT);
    __global const uint *slots = queue_entries(&scene, group, QUEUE_INTERSECT);
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE)
        intersect(&scene, group, slots[i]);
    queue_clear(&scene, group, QUEUE_INTERSECT);
}
