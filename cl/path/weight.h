/* The largest weight of a path, for statistics and warnings. */
#ifndef CLVOL_PATH_WEIGHT_H
#define CLVOL_PATH_WEIGHT_H
#include "core/scene.h"

INLINE void record_weight(const Scene *scene, uint slot, float weight)
{
    if (weight > path_largest_weight(scene, slot))
        set_path_largest_weight(scene, slot, weight);
}

#endif
