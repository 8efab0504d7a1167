/* Path slots and queues: how stages hand paths to each other.

   A work-group owns CLVOL_GROUP_SLOTS slots and its own part of every queue, so that groups never
   wait for each other.  A queue holds slot numbers; its order is not defined and nothing depends on it.
   Stages push by the transitions of their contracts (clvol/layout/stages.py), and the stage that wakes idle slots by
   from_idle(), before its loop: nothing else calls queue_push. */
#ifndef CLVOL_PATH_QUEUES_H
#define CLVOL_PATH_QUEUES_H
#include "core/scene.h"

INLINE __global uint *queue_length(const Scene *scene, uint group, uint queue)
{
    return scene->queue_lengths + group * QUEUE_LENGTHS_STRIDE + queue;
}

INLINE __global uint *queue_entries(const Scene *scene, uint group, uint queue)
{
    return scene->queues + (group * QUEUE_COUNT + queue) * CLVOL_GROUP_SLOTS;
}

/* Slots of the group that hold no path. */
INLINE __global uint *idle_slots(const Scene *scene, uint group)
{
    return scene->queue_lengths + group * QUEUE_LENGTHS_STRIDE + QUEUE_COUNT;
}

/* Adds to a count of the group's own, and returns what it was.  A group of one work-item shares it with nobody.  A
   macro, so that what looks for races names the place that adds. */
#if CLVOL_LOCAL_SIZE == 1
#define group_atomic_add(count, more) ((*(count) += (more)) - (more))
#else
#define group_atomic_add(count, more) atomic_add(count, more)
#endif

/* Paths of the queue that its stage has handled so far; it runs over. */
INLINE __global uint *queue_handled(const Scene *scene, uint group, uint queue)
{
    return scene->queue_lengths + group * QUEUE_LENGTHS_STRIDE + QUEUE_COUNT + 1 + queue;
}

INLINE void queue_push(const Scene *scene, uint group, uint queue, uint slot)
{
    const uint place = group_atomic_add(queue_length(scene, group, queue), 1);
    queue_entries(scene, group, queue)[place] = slot;
}

/* Empties a queue once the whole group has read its length and entries; nobody pushes to the queue that its own stage
   reads, once the group has passed the barrier behind what wakes idle slots (kernels/stage.cl). */
INLINE void queue_clear(const Scene *scene, uint group, uint queue)
{
    barrier(CLK_GLOBAL_MEM_FENCE);
    if (get_local_id(0) == 0) {
        *queue_handled(scene, group, queue) += *queue_length(scene, group, queue);
        *queue_length(scene, group, queue) = 0;
    }
}

#endif
