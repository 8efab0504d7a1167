/* Phase functions.  Directions point along travel: cos_theta = wo·wi is 1 for straight on, and g > 0
   scatters forward.  Every pdf is in solid angle and equals the phase function itself, so that a
   sampled direction has weight 1. */
#ifndef CLVOL_PHASE_H
#define CLVOL_PHASE_H
#include "core/sampling.h"

/* Henyey-Greenstein.  A negative g is the lobe of -g about the opposite direction: hg_sample and hg_pdf
   take |g| and measure from the peak, so that nothing cancels for |g| -> 1 (METHODS §7). */
INLINE float3 hg_peak(float g, float3 wo) { return with_sign(1.0f, g) * wo; }

/* 1 - cos and 1 + cos by inversion, without a branch at g = 0. */
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
        const float3 difference = hg_peak(medium->phase_g, wo) - wi; /* half its square is 1 - cos, exactly so near 0 */
        return hg_pdf(abs_of(medium->phase_g), 0.5f * dot(difference, difference));
    }
    return INV_FOUR_PI;
}

INLINE float3 phase_sample(__global const Medium *medium, float3 wo, float u, float v, float *pdf)
{
    if (CLVOL_HAS_HG && (!CLVOL_HAS_ISOTROPIC || medium->phase_kind == PHASE_HG)) {
        const float g = abs_of(medium->phase_g);
        const float2 cosine = hg_sample(g, u);
        const float sine = sqrt(cosine.x * cosine.y);
        const float2 turn = cos_sin_turn(v);
        *pdf = hg_pdf(g, cosine.x);
        return normalize(to_frame(hg_peak(medium->phase_g, wo), sine * turn.x, sine * turn.y, 1.0f - cosine.x));
    }
    *pdf = INV_FOUR_PI;
    return sphere_direction(u, v);
}

#endif
