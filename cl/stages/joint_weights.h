/* Weights of walks through media that overlap. */
#ifndef CLVOL_STAGES_JOINT_WEIGHTS_H
#define CLVOL_STAGES_JOINT_WEIGHTS_H
#include "core/types.h"

/* The factor by which a walk changed the path's weight; what had no weight keeps none. */
INLINE Spectrum weight_ratio(Spectrum after, Spectrum before)
{
#if CLVOL_SPECTRUM == 1
    return before != 0.0f ? after / before : 0.0f;
#else
    return (Spectrum)(before.x != 0.0f ? after.x / before.x : 0.0f, before.y != 0.0f ? after.y / before.y : 0.0f,
                      before.z != 0.0f ? after.z / before.z : 0.0f);
#endif
}

/* Weights multiply, each walk's taken from what the path weighed before all of them. */
#define JOINT_WEIGHTS (CLVOL_WEIGHTED && CLVOL_HAS_OVERLAP)

#endif
