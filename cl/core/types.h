/* Basic types shared by every stage.  Nothing here reads a buffer.

   A Spectrum is what a path carries: one number when the scene is grey or when a path follows one
   channel, else three.  It lives in registers only; buffers hold one float per channel. */
#ifndef CLVOL_CORE_TYPES_H
#define CLVOL_CORE_TYPES_H

#include "core/math.h"

#if CLVOL_SPECTRUM == 1
typedef float Spectrum;
#define spectrum_max(s) (s)
#define spectrum_mean(s) (s)
#else
typedef float3 Spectrum;
#define spectrum_max(s) max_of((s).x, max_of((s).y, (s).z))
#define spectrum_mean(s) (((s).x + (s).y + (s).z) * (1.0f / 3.0f))
#endif

/* A half-line o + t d; d is a unit vector in world space, and whatever an affine map makes of it
   in a medium's index space, so that t is always a world length. */
typedef struct {
    float3 o;
    float3 d;
} Ray;

/* Affine map as the rows of a 3x4 matrix. */
INLINE float3 transform_point(__global const float *m, float3 p)
{
    return (float3)(m[0] * p.x + (m[1] * p.y + (m[2] * p.z + m[3])), m[4] * p.x + (m[5] * p.y + (m[6] * p.z + m[7])),
                    m[8] * p.x + (m[9] * p.y + (m[10] * p.z + m[11])));
}

INLINE float3 transform_vector(__global const float *m, float3 v)
{
    return (float3)(m[0] * v.x + (m[1] * v.y + m[2] * v.z), m[4] * v.x + (m[5] * v.y + m[6] * v.z),
                    m[8] * v.x + (m[9] * v.y + m[10] * v.z));
}

INLINE Ray transform_ray(__global const float *m, Ray ray)
{
    Ray local_ray;
    local_ray.o = transform_point(m, ray.o);
    local_ray.d = transform_vector(m, ray.d);
    return local_ray;
}

#endif
