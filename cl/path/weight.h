/* The largest weight of a path, for statistics and warnings. */
#ifndef CLVOL_PATH_WEIGHT_H
#define CLVOL_PATH_WEIGHT_H

/* The weight that most paths have until roulette and absorption take part of them: 1, or where walks let them go on
   more often than they collide (stages/background.h) less. */
#define FOLLOWED_WEIGHT (CLVOL_EXPECTS_BACKGROUND ? 0.5f : 1.0f)
#include "core/scene.h"

INLINE void record_weight(const Scene *scene, uint slot, float weight)
{
    if (weight > path_largest_weight(scene, slot))
        set_path_largest_weight(scene, slot, weight);
}

#endif
