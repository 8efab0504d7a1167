/* Lambertian reflection. */
#ifndef CLVOL_BSDF_DIFFUSE_H
#define CLVOL_BSDF_DIFFUSE_H
#if CLVOL_BSDF_DIFFUSE
#include "bsdf/sample.h"

INLINE bool diffuse_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u,
                           float v, int channel, BsdfSample *sample)
{
    const float3 wo = cosine_direction(u, v);
    return scattered_sample(sample, wo, reflectance(scene, material, uv, channel), INV_PI * wo.z, 1.0f) && wi.z > 0.0f;
}

INLINE Spectrum diffuse_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float3 wo,
                              int channel, float *pdf)
{
    *pdf = wi.z > 0.0f && wo.z > 0.0f ? INV_PI * wo.z : 0.0f;
    return reflectance(scene, material, uv, channel) * *pdf;
}

#endif
#endif
