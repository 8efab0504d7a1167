/* Boundary of microfacets between two dielectrics (Walter et al. 2007). */
#ifndef CLVOL_BSDF_ROUGH_DIELECTRIC_H
#define CLVOL_BSDF_ROUGH_DIELECTRIC_H
#if CLVOL_BSDF_ROUGH_DIELECTRIC
#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"
#include "bsdf/sample.h"

/* Value, pdf and colour apart, of wo by the facet of normal m (m.z > 0): the half vector, reflected or refracted.
   The Jacobian of refraction has |wo·m| eta² / (wi·m + eta wo·m)²; the eta² of the value cancels against the 1 / eta²
   of radiance. */
INLINE float2 facet_value(FACETS *material, float3 wi, float3 wo, float3 m, Fresnel fresnel, bool reflects)
{
    const float cos_i = dot_of(wi, m), cos_o = dot_of(wo, m);
    if (cos_i * wi.z <= 0.0f || cos_o * wo.z <= 0.0f)
        return (float2)(0.0f);
    const float density = microfacet_density(material, m);
    const float value = density * shadowing_over_cos(material, wi) * shadowing(material, wo);
    const float pdf = density * visibility_over_cos(material, wi);
    if (reflects)
        return 0.25f * fresnel.reflectance * (float2)(value, pdf);
    const float root = cos_i + fresnel.eta * cos_o;
    const float jacobian = (1.0f - fresnel.reflectance) * abs_of(cos_i * cos_o) / (root * root);
    return jacobian * (float2)(value, fresnel.eta * fresnel.eta * pdf);
}

INLINE bool rough_dielectric_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi,
                                    float u, float v, float pick, int channel, BsdfSample *sample)
{
    if (wi.z == 0.0f)
        return false;
    if (material->ior == 1.0f) /* a boundary of nothing: the lobe of refraction is a delta */
        return delta_sample(sample, -wi, specular_transmittance(scene, material, uv, channel), 1.0f);
    LOAD_FACETS(scene, material, uv)
    const float3 m = sample_visible_normal(FACETS_OF(material), wi.z > 0.0f ? wi : -wi, u, v);
    const float cos_m = dot_of(wi, m);
    const Fresnel fresnel = fresnel_dielectric(cos_m, material->ior);
    const bool reflects = happens(pick, fresnel.reflectance);
    const float inverse = 1.0f / fresnel.eta;
    const float3 wo = reflects ? 2.0f * cos_m * m - wi : (cos_m * inverse + fresnel.cos_t) * m - inverse * wi;
    if ((wo.z * wi.z > 0.0f) != reflects || wo.z == 0.0f)
        return false;
    const float pdf = facet_value(FACETS_OF(material), wi, wo, m, fresnel, reflects).y;
    const float ratio = shadowing(FACETS_OF(material), wo) * shadowing_over_cos(FACETS_OF(material), wi) /
                        visibility_over_cos(FACETS_OF(material), wi);
    const Spectrum weight = reflects ? ratio * specular_reflectance(scene, material, uv, channel)
                                     : ratio * inverse * inverse * specular_transmittance(scene, material, uv, channel);
    return scattered_sample(sample, wo, weight, pdf, reflects ? 1.0f : fresnel.eta) && pdf < INFINITY;
}

INLINE Spectrum rough_dielectric_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi,
                                       float3 wo, int channel, float *pdf)
{
    *pdf = 0.0f;
    const bool reflects = wi.z * wo.z > 0.0f;
    const float eta = wi.z > 0.0f ? material->ior : 1.0f / material->ior;
    float3 m = wi + (reflects ? 1.0f : eta) * wo;
    const float square = dot_of(m, m);
    if (wi.z * wo.z == 0.0f || material->ior == 1.0f || square == 0.0f)
        return (Spectrum)(0.0f);
    LOAD_FACETS(scene, material, uv)
    m *= with_sign(1.0f / sqrt_of(square), m.z);
    const Fresnel fresnel = fresnel_dielectric(dot_of(wi, m), material->ior);
    const float2 found = facet_value(FACETS_OF(material), wi, wo, m, fresnel, reflects);
    *pdf = found.y;
    return found.x * (reflects ? specular_reflectance(scene, material, uv, channel)
                               : specular_transmittance(scene, material, uv, channel));
}

#endif
#endif
