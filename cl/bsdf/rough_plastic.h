/* A diffuse base under a coat of microfacets.

   What the coat lets through, over the cosine of incidence in COAT_ENTRIES steps, is in material_tables
   (clvol/tables/materials.py). */
#ifndef CLVOL_BSDF_ROUGH_PLASTIC_H
#define CLVOL_BSDF_ROUGH_PLASTIC_H
#if CLVOL_BSDF_ROUGH_PLASTIC
#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"
#include "bsdf/plastic.h"
#include "bsdf/sample.h"

INLINE float coat_transmittance(const Scene *scene, __global const Material *material, float cosine)
{
    __global const float *table = scene->material_tables + material->table;
    const float at = cosine * (float)(COAT_ENTRIES - 1);
    const int entry = clamp_int((int)at, 0, COAT_ENTRIES - 2);
    return lerp(table[entry], table[entry + 1], at - (float)entry);
}

INLINE Spectrum rough_plastic_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi,
                                    float3 wo, int channel, float *pdf)
{
    *pdf = 0.0f;
    if (wi.z <= 0.0f || wo.z <= 0.0f)
        return (Spectrum)(0.0f);
    const float in = coat_transmittance(scene, material, wi.z), out = coat_transmittance(scene, material, wo.z);
    LOAD_FACETS(scene, material, uv)
    const float3 m = direction_of(wi + wo);
    const float density = 0.25f * microfacet_density(FACETS_OF(material), m);
    const float coat = density * shadowing_over_cos(FACETS_OF(material), wi) * shadowing(FACETS_OF(material), wo) *
                       fresnel_dielectric(dot_of(wi, m), material->ior).reflectance;
    const float probability = coat_probability(material, 1.0f - in);
    *pdf = lerp(INV_PI * wo.z, density * visibility_over_cos(FACETS_OF(material), wi), probability);
    return coat * specular_reflectance(scene, material, uv, channel) +
           INV_PI * wo.z * in * out * base_albedo(scene, material, uv, channel);
}

INLINE bool rough_plastic_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u,
                                 float v, float pick, int channel, BsdfSample *sample)
{
    if (wi.z <= 0.0f)
        return false;
    float3 wo = cosine_direction(u, v);
    if (happens(pick, coat_probability(material, 1.0f - coat_transmittance(scene, material, wi.z)))) {
        LOAD_FACETS(scene, material, uv)
        const float3 m = sample_visible_normal(FACETS_OF(material), wi, u, v);
        wo = 2.0f * dot_of(wi, m) * m - wi;
    }
    float pdf;
    const Spectrum value = rough_plastic_value(scene, material, uv, wi, wo, channel, &pdf);
    return pdf > 0.0f && scattered_sample(sample, wo, value / pdf, pdf, 1.0f);
}

#endif
#endif
