/* Phase functions.  Directions point along travel: cos_theta = wo·wi is 1 for straight on, and g > 0
   scatters forward.  Every pdf is in solid angle and equals the phase function itself, so that a
   sampled direction has weight 1. */
#ifndef CLVOL_PHASE_H
#define CLVOL_PHASE_H
#include "core/sampling.h"

/* 1 - cos and 1 + cos of the Henyey-Greenstein inversion, without cancellation for |g| -> 1 and
   without a branch at g = 0 (METHODS §7). */
INLINE float2 hg_sample(float g, float u)
{
    const float denominator = 1.0f - g + 2.0f * g * u;
    const float inverse2 = 1.0f / (denominator * denominator);
    const float one_minus = 2.0f * (1.0f - u) * (1.0f - g) * (1.0f - g) * (1.0f + g * u) * inverse2;
    const float one_plus = 2.0f * u * (1.0f + g) * (1.0f + g) * (1.0f - g + g * u) * inverse2;
    return (float2)(one_minus, one_plus);
}

/* With x = 1 - cos: 1 + g² - 2 g cos = (1 - g)² + 2 g x. */
INLINE float hg_pdf(float g, float one_minus_cos)
{
    const float d = 2.0f * g * one_minus_cos + (1.0f - g) * (1.0f - g);
    return INV_FOUR_PI * (1.0f - g) * (1.0f + g) / (d * sqrt(d));
}

INLINE float phase_pdf(__global const Medium *medium, float3 wo, float3 wi)
{
    if (CLVOL_HAS_HG && (!CLVOL_HAS_ISOTROPIC || medium->phase_kind == PHASE_HG)) {
        const float3 half_difference = wo - wi; /* |wo - wi|² / 2 = 1 - cos, exact near the forward peak */
        return hg_pdf(medium->phase_g, 0.5f * dot(half_difference, half_difference));
    }
    return INV_FOUR_PI;
}

INLINE float3 phase_sample(__global const Medium *medium, float3 wo, float u, float v, float *pdf)
{
    if (CLVOL_HAS_HG && (!CLVOL_HAS_ISOTROPIC || medium->phase_kind == PHASE_HG)) {
        const float2 cosine = hg_sample(medium->phase_g, u);
        const float sine = sqrt(cosine.x * cosine.y);
        const float2 turn = cos_sin_turn(v);
        *pdf = hg_pdf(medium->phase_g, cosine.x);
        return normalize(to_frame(wo, sine * turn.x, sine * turn.y, 1.0f - cosine.x));
    }
    *pdf = INV_FOUR_PI;
    return sphere_direction(u, v);
}

#endif
