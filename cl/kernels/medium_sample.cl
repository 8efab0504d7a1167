/* From: MEDIUM
   To: SHADE (a collision, what `intersect` found behind the media, or a walk that needs another wave)
   Reads: ray, interval or hit, the media it is inside of, beta, majorants, volumes.
   Writes: at a collision its place, event and medium; beta; radiance that media emit; counts. */
#include "stages/medium_sample.h"

__kernel __attribute__((reqd_work_group_size(CLVOL_LOCAL_SIZE, 1, 1))) void medium_sample_kernel(CLVOL_ARGUMENTS)
{
    const Scene scene = CLVOL_SCENE;
    const uint group = get_group_id(0);
    const uint count = *queue_counter(&scene, group, QUEUE_MEDIUM);
    __global const uint *slots = queue_entries(&scene, group, QUEUE_MEDIUM);
    uint steps = 0;
    for (uint i = get_local_id(0); i < count; i += CLVOL_LOCAL_SIZE) {
        if (steps < STAGE_STEPS)
            steps += medium_sample(&scene, group, slots[i]);
        else
            stand_by(&scene, group, slots[i], EVENT_WALK);
    }
    queue_clear(&scene, group, QUEUE_MEDIUM);
}
