/* Basic types shared by every stage.  Nothing here reads a buffer.

   A Spectrum is what a path carries: one number when the scene is grey or when a path follows one
   channel, else three.  An Extinction is a coefficient or transmittance: three numbers only where a path
   carries several channels that the media attenuate differently.  Both live in registers only; buffers
   hold one float per channel. */
#ifndef CLVOL_CORE_TYPES_H
#define CLVOL_CORE_TYPES_H
#include "core/math.h"

#if CLVOL_SPECTRUM == 1
typedef float Spectrum;
#define spectrum_max(s) abs_of(s)
#define spectrum_mean(s) abs_of(s)
#define spectrum_signed_mean(s) (s)
#else
typedef float3 Spectrum;
#define spectrum_max(s) largest3(s)
#define spectrum_mean(s) mean3(s)
#define spectrum_signed_mean(s) (((s).x + (s).y + (s).z) * (1.0f / 3.0f))
#endif

#if CLVOL_EXTINCTION == 1
typedef float Extinction;
#define extinction_max(e) abs_of(e)
#define extinction_least(e) (e)
#else
typedef float3 Extinction;
#define extinction_max(e) largest3(e)
#define extinction_least(e) min_of((e).x, min_of((e).y, (e).z))
#endif

/* Largest and mean magnitude of three channels: weights may be negative. */
INLINE float largest3(float3 v) { return max_of(abs_of(v.x), max_of(abs_of(v.y), abs_of(v.z))); }
INLINE float mean3(float3 v) { return (abs_of(v.x) + abs_of(v.y) + abs_of(v.z)) * (1.0f / 3.0f); }

/* An rgb value as the path carries it; `channel` is the one it follows, if it follows one. */
INLINE Spectrum to_spectrum(float3 rgb, int channel)
{
#if CLVOL_SPECTRUM == 3
    return rgb;
#elif CLVOL_ONE_CHANNEL_PER_PATH
    return channel == 0 ? rgb.x : (channel == 1 ? rgb.y : rgb.z);
#else
    return rgb.x;
#endif
}

INLINE float3 load_vector(__global const float *v) { return (float3)(v[0], v[1], v[2]); }

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
