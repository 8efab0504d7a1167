/* Smooth boundary between two dielectrics, and a thin pane: delta lobes only. */
#ifndef CLVOL_BSDF_DIELECTRIC_H
#define CLVOL_BSDF_DIELECTRIC_H
#if CLVOL_BSDF_DIELECTRIC || CLVOL_BSDF_THIN_DIELECTRIC
#include "bsdf/fresnel.h"
#include "bsdf/sample.h"

INLINE bool dielectric_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float pick,
                              int channel, BsdfSample *sample)
{
    const Fresnel fresnel = fresnel_dielectric(wi.z, material->ior);
    if (happens(pick, fresnel.reflectance))
        return delta_sample(sample, mirrored(wi), specular_reflectance(scene, material, uv, channel), 1.0f);
    const float inverse = 1.0f / fresnel.eta;
    const float3 wo = (float3)(-inverse * wi.x, -inverse * wi.y, fresnel.cos_t);
    const Spectrum transmittance = specular_transmittance(scene, material, uv, channel);
    return delta_sample(sample, wo, inverse * inverse * transmittance, fresnel.eta);
}

/* What a pane passes straight on. */
INLINE Spectrum thin_dielectric_transmission(const Scene *scene, __global const Material *material, float2 uv,
                                             float cos_i, int channel)
{
    return (1.0f - thin_reflectance(cos_i, material->ior)) * specular_transmittance(scene, material, uv, channel);
}

INLINE bool thin_dielectric_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi,
                                   float pick, int channel, BsdfSample *sample)
{
    if (happens(pick, thin_reflectance(wi.z, material->ior)))
        return delta_sample(sample, mirrored(wi), specular_reflectance(scene, material, uv, channel), 1.0f);
    delta_sample(sample, -wi, specular_transmittance(scene, material, uv, channel), 1.0f);
    sample->passes = true;
    return true;
}

#endif
#endif
