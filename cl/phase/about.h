/* Directions about an axis. */
#ifndef CLVOL_PHASE_ABOUT_H
#define CLVOL_PHASE_ABOUT_H
#include "core/sampling.h"

/* The direction whose cosine with the axis is given as 1 - cos and 1 + cos, turned by the uniform number v. */
INLINE float3 direction_about(float3 axis, float2 cosine, float v)
{
    const float sine = sqrt_of(cosine.x * cosine.y);
    const float2 turn = cos_sin_turn(v);
    return unit_of(to_frame(axis, sine * turn.x, sine * turn.y, 1.0f - cosine.x));
}

#endif
