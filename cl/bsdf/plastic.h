/* A diffuse base under a smooth dielectric coat. */
#ifndef CLVOL_BSDF_PLASTIC_H
#define CLVOL_BSDF_PLASTIC_H
#if CLVOL_BSDF_PLASTIC || CLVOL_BSDF_ROUGH_PLASTIC
#include "bsdf/fresnel.h"
#include "bsdf/sample.h"

/* Share of the samples that the coat gets, where it reflects `coat` of the light. */
INLINE float coat_probability(__global const Material *material, float coat)
{
    const float specular = coat * material->specular_weight;
    const float base = (1.0f - coat) * (1.0f - material->specular_weight);
    return specular + base > 0.0f ? specular / (specular + base) : 0.0f;
}

/* Albedo of the base with all reflections between it and the coat, divided by the coat's eta²: what leaves is spread
   over a larger solid angle.  `nonlinear`: the colour is taken at each reflection. */
INLINE Spectrum base_albedo(const Scene *scene, __global const Material *material, float2 uv, int channel)
{
    const Spectrum albedo = reflectance(scene, material, uv, channel);
    const float inner = material->inner_reflectance, inverse = 1.0f / (material->ior * material->ior);
    return material->nonlinear ? inverse * albedo / ((Spectrum)(1.0f) - inner * albedo)
                               : inverse / (1.0f - inner) * albedo;
}

INLINE Spectrum plastic_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float3 wo,
                              int channel, float *pdf)
{
    *pdf = 0.0f;
    if (wi.z <= 0.0f || wo.z <= 0.0f)
        return (Spectrum)(0.0f);
    const float in = fresnel_dielectric(wi.z, material->ior).reflectance;
    const float out = fresnel_dielectric(wo.z, material->ior).reflectance;
    *pdf = (1.0f - coat_probability(material, in)) * INV_PI * wo.z;
    return INV_PI * wo.z * (1.0f - in) * (1.0f - out) * base_albedo(scene, material, uv, channel);
}

INLINE bool plastic_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u,
                           float v, float pick, int channel, BsdfSample *sample)
{
    if (wi.z <= 0.0f)
        return false;
    const float coat = fresnel_dielectric(wi.z, material->ior).reflectance;
    const float probability = coat_probability(material, coat);
    if (happens(pick, probability))
        return delta_sample(sample, mirrored(wi),
                            coat / probability * specular_reflectance(scene, material, uv, channel), 1.0f);
    float pdf;
    const float3 wo = cosine_direction(u, v);
    const Spectrum value = plastic_value(scene, material, uv, wi, wo, channel, &pdf);
    return pdf > 0.0f && scattered_sample(sample, wo, value / pdf, pdf, 1.0f);
}

#endif
#endif
