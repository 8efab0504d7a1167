/* Mixtures of phase functions whose weight is a volume.

   Each lobe has the share a + b w(p): a is its weight, and b is in a record of its own, as many behind it as the medium
   has lobes.  The first of those names the volume of w, -1 where shares are the same everywhere. */
#ifndef CLVOL_PHASE_VARIED_H
#define CLVOL_PHASE_VARIED_H
#if CLVOL_HAS_VARIED_PHASE && CLVOL_HAS_SCATTERING
#include "density/volume.h"
#include "phase/phase.h"

/* Of a lobe that may differ from place to place by itself. */
INLINE float lobe_pdf_at(const Scene *scene, __global const Phase *lobe, float3 p, float3 wo, float3 wi)
{
#if CLVOL_HAS_VARIED_FLAKES
    if (IS_SGGX(lobe))
        return sggx_pdf_at(scene, lobe, p, wo, wi);
#endif
    return lobe_pdf(lobe, wo, wi);
}

INLINE float3 lobe_sample_at(const Scene *scene, __global const Phase *lobe, float3 p, float3 wo, float u, float v,
                             float *pdf)
{
#if CLVOL_HAS_VARIED_FLAKES
    if (IS_SGGX(lobe))
        return sggx_sample_at(scene, lobe, p, wo, u, v, pdf);
#endif
    return lobe_sample(lobe, wo, u, v, pdf);
}

INLINE float mixture_weight(const Scene *scene, __global const Medium *medium, float3 p)
{
    const int number = scene->phases[medium->phase_first + medium->phase_count].kind;
    if (number < 0)
        return 0.0f;
    __global const Volume *volume = scene->volumes + number;
    return clamp_to(volume_value(scene, volume, transform_point(volume->world_to_index, p), 0), 0.0f, 1.0f);
}

INLINE float lobe_share(__global const Phase *lobe, int count, float weight)
{
    return max_of(lobe->weight + weight * lobe[count].g, 0.0f);
}

INLINE float varied_phase_pdf(const Scene *scene, __global const Medium *medium, float3 p, float3 wo, float3 wi)
{
    __global const Phase *lobes = scene->phases + medium->phase_first;
    const float weight = mixture_weight(scene, medium, p);
    float pdf = 0.0f;
    for (int n = 0; n < medium->phase_count; ++n)
        pdf += lobe_share(lobes + n, medium->phase_count, weight) * lobe_pdf_at(scene, lobes + n, p, wo, wi);
    return pdf;
}

/* As phase_sample; lobes of share 0 are never chosen. */
INLINE float3 varied_phase_sample(const Scene *scene, __global const Medium *medium, float3 p, float3 wo, float u,
                                  float v, float pick, float *pdf)
{
    __global const Phase *lobe = scene->phases + medium->phase_first, *chosen = lobe;
    const float weight = mixture_weight(scene, medium, p);
    for (int n = 0; n < medium->phase_count; ++n, ++lobe) {
        const float share = lobe_share(lobe, medium->phase_count, weight);
        if (!(share > 0.0f))
            continue;
        chosen = lobe;
        if (pick < share)
            break;
        pick -= share;
    }
    const float3 wi = lobe_sample_at(scene, chosen, p, wo, u, v, pdf);
    *pdf = varied_phase_pdf(scene, medium, p, wo, wi);
    return wi;
}
#define PHASE_PDF(p, wo, wi) varied_phase_pdf(scene, medium, p, wo, wi)
#define PHASE_SAMPLE(p, wo, u, v, pick, pdf) varied_phase_sample(scene, medium, p, wo, u, v, pick, pdf)
#else
#define PHASE_PDF(p, wo, wi) phase_pdf(scene, medium, wo, wi)
#define PHASE_SAMPLE(p, wo, u, v, pick, pdf) phase_sample(scene, medium, wo, u, v, pick, pdf)
#endif

#endif
