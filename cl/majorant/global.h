/* global: one bound for the whole medium, a single segment. */
#ifndef CLVOL_MAJORANT_GLOBAL_H
#define CLVOL_MAJORANT_GLOBAL_H
#include "tracking/interface.h"

typedef struct {
    float t;
    float t_end;
    float majorant;
    int cell;
} MajorantWalk;

INLINE MajorantWalk majorant_begin(const MediumRay *in)
{
    MajorantWalk walk = {0.0f, 0.0f, in->rate * in->medium->majorant, 0};
    return walk;
}

INLINE bool majorant_next(const MediumRay *in, MajorantWalk *walk)
{
    walk->t = walk->t_end;
    walk->t_end = in->t_max;
    return walk->t < in->t_max;
}

#endif
