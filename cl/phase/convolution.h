/* Phase functions turned by one more scattering: the convolution over directions of a Henyey-Greenstein lobe with a
   medium's phase function, in closed form.  The Legendre coefficients of Henyey-Greenstein are the powers of g, those
   of a convolution the products (the addition theorem), so that two such lobes make one of the product of their g. */
#ifndef CLVOL_PHASE_CONVOLUTION_H
#define CLVOL_PHASE_CONVOLUTION_H
#include "core/scene.h"
#include "phase/hg.h"
#include "phase/kinds.h"

/* Henyey-Greenstein of any g between -1 and 1, directions of travel. */
INLINE float hg_value(float g, float3 from, float3 to)
{
    const float3 difference = hg_peak(g, from) - to;
    return hg_density(abs_of(g), 0.5f * dot_of(difference, difference));
}

/* Integral over w of p(from, w) HG_g(w, to), where p is a lobe. */
INLINE float lobe_convolved(__global const Phase *lobe, float g, float3 from, float3 to)
{
    if (IS_PHASE(lobe, HG))
        return hg_value(g * lobe->g, from, to);
    if (IS_PHASE(lobe, RAYLEIGH)) {
        const float cosine = dot_of(from, to); /* Rayleigh's is 1/4pi (1 + P2 / 2) */
        return INV_FOUR_PI * (1.0f + g * g * (0.75f * cosine * cosine - 0.25f));
    }
    return INV_FOUR_PI;
}

/* The same of a medium's phase function. */
INLINE float phase_convolved(const Scene *scene, __global const Medium *medium, float g, float3 from, float3 to)
{
    __global const Phase *lobes = scene->phases + medium->phase_first;
    if (!CLVOL_HAS_BLEND)
        return lobe_convolved(lobes, g, from, to);
    float sum = 0.0f;
    for (int n = 0; n < medium->phase_count; ++n)
        sum += lobes[n].weight * lobe_convolved(lobes + n, g, from, to);
    return sum;
}

/* Mean cosine of a medium's phase function. */
INLINE float mean_cosine(const Scene *scene, __global const Medium *medium)
{
    __global const Phase *lobes = scene->phases + medium->phase_first;
    float sum = 0.0f;
    for (int n = 0; n < (CLVOL_HAS_BLEND ? medium->phase_count : 1); ++n)
        sum += IS_PHASE(lobes + n, HG) ? (CLVOL_HAS_BLEND ? lobes[n].weight : 1.0f) * lobes[n].g : 0.0f;
    return sum;
}

#endif
