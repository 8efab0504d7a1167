/* A work-item's paths of a stage that walks in lanes. */
#include "kernels/lanes.cl"
#include "kernels/steps.h"
#include "path/transitions.h"

INLINE void handle_paths(const Scene *scene, uint group, __global const uint *slots, uint count)
{
    const LanesWalked walked = walk_lanes(scene, group, slots, get_local_id(0), CLVOL_LOCAL_SIZE, count, STAGE_STEPS);
    for (uint i = walked.next; i < count; i += CLVOL_LOCAL_SIZE)
        to_shade(scene, group, slots[i], STAGE_STANDS_BY);
    const uint own = group * CLVOL_GROUP_SLOTS + get_local_id(0);
    set_path_lane_steps(scene, own, path_lane_steps(scene, own) + walked.lane_steps);
    set_path_busy_lane_steps(scene, own, path_busy_lane_steps(scene, own) + walked.busy_steps);
}
