/* The phase function sggx: which microflakes a lobe has (cl/phase/flakes.h), and what they do to the extinction. */
#ifndef CLVOL_PHASE_SGGX_H
#define CLVOL_PHASE_SGGX_H
#if CLVOL_PHASE_SGGX
#include "core/scene.h"
#if CLVOL_HAS_VARIED_FLAKES
#include "phase/flakes_at.h"
#else
#include "phase/flakes.h"

INLINE __global const float *sggx_table(__global const Phase *lobe)
{
    return (__global const float *)(lobe + as_int(lobe->g));
}

INLINE float sggx_pdf(__global const Phase *lobe, float3 wo, float3 wi) { return flakes_pdf(sggx_table(lobe), wo, wi); }

INLINE float3 sggx_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    return flakes_sample(sggx_table(lobe), wo, u, v, pdf);
}

/* By what a medium's extinction is multiplied for light along w. */
INLINE float projected_area(const Scene *scene, __global const Medium *medium, float3 w)
{
    __global const Phase *lobe = scene->phases + medium->phase_first;
    return IS_PHASE(lobe, SGGX) ? flakes_area(sggx_table(lobe), w) : 1.0f;
}

/* That near a point, for light from anywhere: about the mean over directions. */
INLINE float mean_area(const Scene *scene, __global const Medium *medium, float3 p)
{
    const float x = projected_area(scene, medium, (float3)(1.0f, 0.0f, 0.0f));
    const float y = projected_area(scene, medium, (float3)(0.0f, 1.0f, 0.0f));
    const float z = projected_area(scene, medium, (float3)(0.0f, 0.0f, 1.0f));
    return (x + y + z) * (1.0f / 3.0f);
}
#endif

#endif
#endif
