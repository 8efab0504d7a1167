/* Pictures that lights which are points throw, as a slide in front of them does. */
#ifndef CLVOL_EMITTER_SLIDE_H
#define CLVOL_EMITTER_SLIDE_H
#include "core/sampling.h"
#include "core/scene.h"

/* Where the direction d meets the plane one before the light, in the frame round its axis that the tables have too
   (device_frame in clvol/tables/textures.py); d is `along` the axis, more than 0. */
INLINE float2 slide_point(__global const Emitter *emitter, float3 d, float along)
{
    const float3 axis = load_vector(emitter->vector);
    return (float2)(dot_of(d, to_frame(axis, 1.0f, 0.0f, 0.0f)), dot_of(d, to_frame(axis, 0.0f, 1.0f, 0.0f))) / along;
}

/* The mean of the picture, as a share of the light without one. */
INLINE float picture_share(__global const Emitter *emitter)
{
    return emitter->first > 0 ? as_float(emitter->primitive) : 1.0f;
}

#endif
