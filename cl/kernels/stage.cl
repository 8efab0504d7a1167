/* The kernel of every stage: each group takes the paths in its part of the stage's queue, and the stage hands each of
   them on.  From which queue and to which others is in the stage's contract (clvol/layout/stages.py), from which the
   macros STAGE* are made.  `python tools/dump_kernel.py SCENE` shows the whole. */
#include "path/transitions.h"
#if CLVOL_LANES
#include "kernels/lanes.cl"
#endif

/* Steps of a work-item beyond which it leaves the other paths to the next wave, so that no launch takes long. */
#define STAGE_STEPS (1u << 13)

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void STAGE_KERNEL(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
#ifdef STAGE_WAKES
    STAGE_WAKES(&scene, group);
    barrier(CLK_GLOBAL_MEM_FENCE); /* slots that fall idle below are not to be looked at above */
#endif
    const uint count = *queue_length(&scene, group, STAGE_QUEUE);
    __global const uint *slots = queue_entries(&scene, group, STAGE_QUEUE);
#if CLVOL_LANES
    const LanesWalked walked = walk_lanes(&scene, group, slots, get_local_id(0), CLVOL_LOCAL_SIZE, count, STAGE_STEPS);
    for (uint i = walked.next; i < count; i += CLVOL_LOCAL_SIZE)
        to_shade(&scene, group, slots[i], STAGE_STANDS_BY);
    const uint own = group * CLVOL_GROUP_SLOTS + get_local_id(0);
    set_path_lane_steps(&scene, own, path_lane_steps(&scene, own) + walked.lane_steps);
    set_path_busy_lane_steps(&scene, own, path_busy_lane_steps(&scene, own) + walked.busy_steps);
#else
#ifdef STAGE_STANDS_BY
    uint steps = 0;
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE) {
        if (steps < STAGE_STEPS)
            steps += STAGE(&scene, group, slots[i]);
        else
            to_shade(&scene, group, slots[i], STAGE_STANDS_BY);
    }
#else
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE)
        STAGE(&scene, group, slots[i]);
#endif
#endif
    queue_clear(&scene, group, STAGE_QUEUE);
}
