/* The kernel of every stage: each group takes the paths in its part of the stage's queue, and the stage hands each of
   them on.  From which queue and to which others is in the stage's contract (clvol/layout/stages.py), from which the
   macros STAGE* are made.  How a group's work-items share and handle the paths is in one_by_one.cl, packets.cl or
   in_lanes.cl.  `python tools/dump_kernel.py SCENE` shows the whole. */
#include "path/transitions.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void STAGE_KERNEL(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
#ifdef STAGE_WAKES
    STAGE_WAKES(&scene, group);
    barrier(CLK_GLOBAL_MEM_FENCE); /* what is woken is handled with the rest */
#endif
    handle_paths(&scene, group, queue_entries(&scene, group, STAGE_QUEUE), *queue_length(&scene, group, STAGE_QUEUE));
    queue_clear(&scene, group, STAGE_QUEUE);
}
