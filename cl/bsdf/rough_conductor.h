/* Metal of microfacets. */
#ifndef CLVOL_BSDF_ROUGH_CONDUCTOR_H
#define CLVOL_BSDF_ROUGH_CONDUCTOR_H
#if CLVOL_BSDF_ROUGH_CONDUCTOR
#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"
#include "bsdf/sample.h"

INLINE bool rough_conductor_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u,
                                   float v, int channel, BsdfSample *sample)
{
    if (wi.z <= 0.0f)
        return false;
    LOAD_FACETS(scene, material, uv)
    const float3 m = sample_visible_normal(FACETS_OF(material), wi, u, v);
    const float cos_m = dot_of(wi, m);
    const float3 wo = 2.0f * cos_m * m - wi;
    if (wo.z <= 0.0f || cos_m <= 0.0f)
        return false;
    const float visibility = visibility_over_cos(FACETS_OF(material), wi);
    const float ratio = shadowing(FACETS_OF(material), wo) * shadowing_over_cos(FACETS_OF(material), wi) / visibility;
    const Spectrum weight = ratio * specular_reflectance(scene, material, uv, channel) *
                            conductor_reflectance(METAL_AT(scene, material, uv), cos_m, channel);
    return scattered_sample(sample, wo, weight, 0.25f * visibility * microfacet_density(FACETS_OF(material), m), 1.0f);
}

INLINE Spectrum rough_conductor_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi,
                                      float3 wo, int channel, float *pdf)
{
    *pdf = 0.0f;
    if (wi.z <= 0.0f || wo.z <= 0.0f)
        return (Spectrum)(0.0f);
    LOAD_FACETS(scene, material, uv)
    const float3 m = direction_of(wi + wo);
    const float density = 0.25f * microfacet_density(FACETS_OF(material), m);
    *pdf = density * visibility_over_cos(FACETS_OF(material), wi);
    const float value = density * shadowing_over_cos(FACETS_OF(material), wi) * shadowing(FACETS_OF(material), wo);
    return value * specular_reflectance(scene, material, uv, channel) *
           conductor_reflectance(METAL_AT(scene, material, uv), dot_of(wi, m), channel);
}

#endif
#endif
