/* Phase functions.  Directions point along travel: cos_theta = wo·wi is 1 for straight on, and g > 0
   scatters forward.  Every pdf is in solid angle and equals the phase function itself, so that a
   sampled direction has weight 1.

   A medium's phase function is a weighted sum of lobes (one, unless some medium blends).  A direction is drawn
   from one lobe, chosen by its weight, and has the pdf of the sum. */
#ifndef CLVOL_PHASE_PHASE_H
#define CLVOL_PHASE_PHASE_H
#if CLVOL_HAS_SCATTERING
#include "core/sampling.h"
#include "core/scene.h"

/* Whether a lobe is of a kind, without a look where no medium has it or none has another. */
#define IS_HG(lobe) (CLVOL_HAS_HG && (!(CLVOL_HAS_ISOTROPIC || CLVOL_HAS_RAYLEIGH) || (lobe)->kind == PHASE_HG))
#define IS_RAYLEIGH(lobe) \
    (CLVOL_HAS_RAYLEIGH && (!(CLVOL_HAS_ISOTROPIC || CLVOL_HAS_HG) || (lobe)->kind == PHASE_RAYLEIGH))

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

/* Rayleigh scattering of unpolarised light. */
INLINE float rayleigh_pdf(float cosine) { return 0.75f * INV_FOUR_PI * (cosine * cosine + 1.0f); }

/* 1 - cos and 1 + cos.  The share of directions within x = 1 - cos of a pole is (x³ - 3 x² + 6 x) / 8.  It is
   inverted from the nearer pole, where x <= 1, so that x keeps its relative precision; Newton's method from a
   guess within 1 % is there after two steps. */
INLINE float2 rayleigh_sample(float u)
{
    const float share = 8.0f * min_of(u, 1.0f - u);
    const float y = share * (1.0f / 6.0f);
    float x = ((0.375f * y + 0.5f) * y + 1.0f) * y;
    for (int step = 0; step < 2; ++step)
        x -= (((x - 3.0f) * x + 6.0f) * x - share) / (3.0f * ((x - 2.0f) * x + 2.0f));
    return u < 0.5f ? (float2)(2.0f - x, x) : (float2)(x, 2.0f - x);
}

INLINE float lobe_pdf(__global const Phase *lobe, float3 wo, float3 wi)
{
    if (IS_HG(lobe)) {
        const float3 difference = hg_peak(lobe->g, wo) - wi; /* half its square is 1 - cos, exactly so near 0 */
        return hg_pdf(abs_of(lobe->g), 0.5f * dot(difference, difference));
    }
    if (IS_RAYLEIGH(lobe))
        return rayleigh_pdf(dot(wo, wi));
    return INV_FOUR_PI;
}

INLINE float3 lobe_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    if (IS_HG(lobe) || IS_RAYLEIGH(lobe)) {
        float3 axis = wo;
        float2 cosine;
        if (IS_HG(lobe)) {
            const float g = abs_of(lobe->g);
            axis = hg_peak(lobe->g, wo);
            cosine = hg_sample(g, u);
            *pdf = hg_pdf(g, cosine.x);
        } else {
            cosine = rayleigh_sample(u);
            *pdf = rayleigh_pdf(1.0f - cosine.x);
        }
        const float sine = sqrt(cosine.x * cosine.y);
        const float2 turn = cos_sin_turn(v);
        return normalize(to_frame(axis, sine * turn.x, sine * turn.y, 1.0f - cosine.x));
    }
    *pdf = INV_FOUR_PI;
    return sphere_direction(u, v);
}

INLINE float phase_pdf(const Scene *scene, __global const Medium *medium, float3 wo, float3 wi)
{
    __global const Phase *lobes = scene->phases + medium->phase_first;
#if CLVOL_HAS_BLEND
    float pdf = 0.0f;
    for (int n = 0; n < medium->phase_count; ++n)
        pdf += lobes[n].weight * lobe_pdf(lobes + n, wo, wi);
    return pdf;
#else
    return lobe_pdf(lobes, wo, wi);
#endif
}

/* `choice` in (0, 1) picks the lobe.  The rarest comes first, where small numbers resolve its weight; the last
   takes what is left, so that rounding never picks a lobe of weight 0. */
INLINE float3 phase_sample(const Scene *scene, __global const Medium *medium, float3 wo, float u, float v,
                           float choice, float *pdf)
{
    __global const Phase *lobe = scene->phases + medium->phase_first;
#if CLVOL_HAS_BLEND
    for (int left = medium->phase_count - 1; left > 0 && choice >= lobe->weight; --left) {
        choice -= lobe->weight;
        ++lobe;
    }
    const float3 wi = lobe_sample(lobe, wo, u, v, pdf);
    if (medium->phase_count > 1)
        *pdf = phase_pdf(scene, medium, wo, wi);
    return wi;
#else
    return lobe_sample(lobe, wo, u, v, pdf);
#endif
}

#endif
#endif
