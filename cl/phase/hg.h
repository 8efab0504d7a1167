/* Henyey-Greenstein.  A negative g is the lobe of -g about the opposite direction: hg_cosine and
   hg_density take |g| and measure from the peak, so that nothing cancels for |g| -> 1 (METHODS §7). */
#ifndef CLVOL_PHASE_HG_H
#define CLVOL_PHASE_HG_H
#include "core/shared.h"
#include "phase/about.h"

INLINE float3 hg_peak(float g, float3 wo) { return with_sign(1.0f, g) * wo; }

/* 1 - cos and 1 + cos by inversion, without a branch at g = 0. */
INLINE float2 hg_cosine(float g, float u)
{
    const float denominator = 1.0f - g + 2.0f * g * u;
    const float inverse2 = 1.0f / (denominator * denominator);
    const float one_minus = 2.0f * (1.0f - u) * (1.0f - g) * (1.0f - g) * (1.0f + g * u) * inverse2;
    const float one_plus = 2.0f * u * (1.0f + g) * (1.0f + g) * (1.0f - g + g * u) * inverse2;
    return (float2)(one_minus, one_plus);
}

/* With x = 1 - cos: 1 + g² - 2 g cos = (1 - g)² + 2 g x. */
INLINE float hg_density(float g, float one_minus_cos)
{
    const float d = 2.0f * g * one_minus_cos + (1.0f - g) * (1.0f - g);
    return INV_FOUR_PI * (1.0f - g) * (1.0f + g) / (d * sqrt_of(d));
}

INLINE float hg_pdf(__global const Phase *lobe, float3 wo, float3 wi)
{
    const float3 difference = hg_peak(lobe->g, wo) - wi; /* half its square is 1 - cos, exactly so near 0 */
    return hg_density(abs_of(lobe->g), 0.5f * dot_of(difference, difference));
}

INLINE float3 hg_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    const float g = abs_of(lobe->g);
    const float2 cosine = hg_cosine(g, u);
    *pdf = hg_density(g, cosine.x);
    return direction_about(hg_peak(lobe->g, wo), cosine, v);
}

#endif
