/* From: GENERATE, and idle slots once there are jobs again
   To: INTERSECT (a new path); a slot for which there is no job stays idle
   Reads: the finished path, the job counter and its limit.
   Writes: results, every field of a new path that is read before it is set. */
#include "stages/generate.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void generate_kernel(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
    wake_idle(&scene, group);
    barrier(CLK_GLOBAL_MEM_FENCE); /* slots that fall idle below are not to be looked at above */
    const uint count = *queue_counter(&scene, group, QUEUE_GENERATE);
    __global const uint *slots = queue_entries(&scene, group, QUEUE_GENERATE);
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE)
        generate(&scene, group, slots[i]);
    queue_clear(&scene, group, QUEUE_GENERATE);
}
