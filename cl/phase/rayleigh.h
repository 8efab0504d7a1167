/* Rayleigh scattering of unpolarised light. */
#ifndef CLVOL_PHASE_RAYLEIGH_H
#define CLVOL_PHASE_RAYLEIGH_H
#include "core/shared.h"
#include "phase/about.h"

INLINE float rayleigh_density(float cosine) { return 0.75f * INV_FOUR_PI * (cosine * cosine + 1.0f); }

/* 1 - cos and 1 + cos.  The share of directions within x = 1 - cos of a pole is (x³ - 3 x² + 6 x) / 8.  It is
   inverted from the nearer pole, where x <= 1, so that x keeps its relative precision; Newton's method from a
   guess within 1 % is there after two steps. */
INLINE float2 rayleigh_cosine(float u)
{
    const float share = 8.0f * min_of(u, 1.0f - u);
    const float y = share * (1.0f / 6.0f);
    float x = ((0.375f * y + 0.5f) * y + 1.0f) * y;
    for (int step = 0; step < 2; ++step)
        x -= (((x - 3.0f) * x + 6.0f) * x - share) / (3.0f * ((x - 2.0f) * x + 2.0f));
    return u < 0.5f ? (float2)(2.0f - x, x) : (float2)(x, 2.0f - x);
}

INLINE float rayleigh_pdf(__global const Phase *lobe, float3 wo, float3 wi) { return rayleigh_density(dot_of(wo, wi)); }

INLINE float3 rayleigh_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    const float2 cosine = rayleigh_cosine(u);
    *pdf = rayleigh_density(1.0f - cosine.x);
    return direction_about(wo, cosine, v);
}

#endif
