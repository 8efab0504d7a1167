/* Phase functions.  Directions point along travel: cos_theta = wo·wi is 1 for straight on, and g > 0
   scatters forward.  Every pdf is in solid angle and equals the phase function itself, so that a
   sampled direction has weight 1.

   A medium's phase function is a weighted sum of lobes (one, unless some medium blends).  A direction is drawn
   from one lobe, chosen by its weight, and has the pdf of the sum. */
#ifndef CLVOL_PHASE_PHASE_H
#define CLVOL_PHASE_PHASE_H
#if CLVOL_HAS_SCATTERING
#include "core/scene.h"
#include "phase/hg.h"
#include "phase/isotropic.h"
#include "phase/kinds.h"
#include "phase/rayleigh.h"
#if CLVOL_PHASE_TABPHASE
#include "phase/tabphase.h"
#endif
#if CLVOL_PHASE_SGGX
#include "phase/sggx.h"
#endif

INLINE float lobe_pdf(__global const Phase *lobe, float3 wo, float3 wi)
{
    if (IS_PHASE(lobe, HG))
        return hg_pdf(lobe, wo, wi);
    if (IS_PHASE(lobe, RAYLEIGH))
        return rayleigh_pdf(lobe, wo, wi);
#if CLVOL_PHASE_TABPHASE
    if (IS_PHASE(lobe, TABPHASE))
        return tabphase_pdf(lobe, wo, wi);
#endif
#if CLVOL_PHASE_SGGX && !CLVOL_HAS_VARIED_FLAKES
    if (IS_SGGX(lobe))
        return sggx_pdf(lobe, wo, wi);
#endif
    return isotropic_pdf(lobe, wo, wi);
}

INLINE float3 lobe_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    if (IS_PHASE(lobe, HG))
        return hg_sample(lobe, wo, u, v, pdf);
    if (IS_PHASE(lobe, RAYLEIGH))
        return rayleigh_sample(lobe, wo, u, v, pdf);
#if CLVOL_PHASE_TABPHASE
    if (IS_PHASE(lobe, TABPHASE))
        return tabphase_sample(lobe, wo, u, v, pdf);
#endif
#if CLVOL_PHASE_SGGX && !CLVOL_HAS_VARIED_FLAKES
    if (IS_SGGX(lobe))
        return sggx_sample(lobe, wo, u, v, pdf);
#endif
    return isotropic_sample(lobe, wo, u, v, pdf);
}

INLINE float phase_pdf(const Scene *scene, __global const Medium *medium, float3 wo, float3 wi)
{
    __global const Phase *lobes = scene->phases + medium->phase_first;
    if (!CLVOL_HAS_BLEND)
        return lobe_pdf(lobes, wo, wi);
    float pdf = 0.0f;
    for (int n = 0; n < medium->phase_count; ++n)
        pdf += lobes[n].weight * lobe_pdf(lobes + n, wo, wi);
    return pdf;
}

/* `pick` in (0, 1) picks the lobe.  The rarest comes first, where small numbers resolve its weight; the last
   takes what is left, so that rounding never picks a lobe of weight 0. */
INLINE float3 phase_sample(const Scene *scene, __global const Medium *medium, float3 wo, float u, float v, float pick,
                           float *pdf)
{
    __global const Phase *lobe = scene->phases + medium->phase_first;
    for (int left = CLVOL_HAS_BLEND ? medium->phase_count - 1 : 0; left > 0 && pick >= lobe->weight; --left) {
        pick -= lobe->weight;
        ++lobe;
    }
    const float3 wi = lobe_sample(lobe, wo, u, v, pdf);
    if (CLVOL_HAS_BLEND && medium->phase_count > 1)
        *pdf = phase_pdf(scene, medium, wo, wi);
    return wi;
}

#endif
#endif
