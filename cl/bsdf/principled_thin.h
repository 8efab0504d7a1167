/* The principled BSDF of a sheet: light passes it, specular or diffuse, and is not bent. */
#ifndef CLVOL_BSDF_PRINCIPLED_THIN_H
#define CLVOL_BSDF_PRINCIPLED_THIN_H
#if CLVOL_BSDF_PRINCIPLED_THIN
#include "bsdf/principled.h"

/* Shares of the light, and how often the lobes are sampled (normalised): diffuse reflection, specular reflection,
   specular transmission; the rest is diffuse transmission. */
typedef struct {
    float roughness, anisotropic, ior;
    float specular, passes; /* of the light that is not specular, what passes */
    float diffuse_rate, specular_rate, specular_passes_rate, passes_rate;
} Sheet;

INLINE Sheet sheet_at(const Scene *scene, __global const Material *material, float2 uv)
{
    Sheet sheet;
    sheet.roughness = PRINCIPLED(ROUGHNESS), sheet.anisotropic = PRINCIPLED(ANISOTROPIC);
    sheet.ior = max_of(PRINCIPLED(ETA), 1e-3f);
    sheet.specular = PRINCIPLED(SPEC_TRANS), sheet.passes = 0.5f * PRINCIPLED(DIFF_TRANS);
    sheet.diffuse_rate = PRINCIPLED(DIFFUSE_RATE) * (1.0f - sheet.specular) * (1.0f - sheet.passes);
    sheet.specular_rate = 0.5f * PRINCIPLED(SPECULAR_RATE) * sheet.specular;
    sheet.specular_passes_rate = 0.5f * PRINCIPLED(THIRD_RATE) * sheet.specular;
    sheet.passes_rate = PRINCIPLED(FOURTH_RATE) * (1.0f - sheet.specular) * sheet.passes;
    const float total = sheet.diffuse_rate + sheet.specular_rate + sheet.specular_passes_rate + sheet.passes_rate;
    const float scale = total > 0.0f ? 1.0f / total : 0.0f;
    sheet.diffuse_rate *= scale, sheet.specular_rate *= scale;
    sheet.specular_passes_rate *= scale, sheet.passes_rate *= scale;
    return sheet;
}

/* What passes is less rough (Burley 2015, figure 15). */
INLINE Facets sheet_facets(const Sheet *sheet, bool passes)
{
    const float scale = passes ? 0.65f * sheet->ior - 0.35f : 1.0f;
    return principled_facets(scale * sheet->roughness, sheet->anisotropic);
}

INLINE Spectrum sheet_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float3 wo,
                            int channel, float *pdf)
{
    *pdf = 0.0f;
    if (wi.z * wo.z == 0.0f)
        return (Spectrum)(0.0f);
    if (wi.z < 0.0f)
        wi = -wi, wo = -wo; /* both sides are alike */
    const Sheet sheet = sheet_at(scene, material, uv);
    const Base base = principled_base(scene, material, uv, channel);
    const bool passes = wo.z < 0.0f;
    const float o = abs_of(wo.z);
    const float3 m = direction_of(wi + (float3)(wo.x, wo.y, o));
    const float cos_i = dot_of(wi, m), cos_o = dot_of(wo, m);
    const Facets facets = sheet_facets(&sheet, passes);
    const bool meets = cos_i > 0.0f && cos_o * wo.z > 0.0f;
    const float density = meets && sheet.specular > 0.0f ? 0.25f * microfacet_density(&facets, m) : 0.0f;
    const float value = sheet.specular * density * shadowing_over_cos(&facets, wi) * shadowing(&facets, wo);
    const float visible = density * visibility_over_cos(&facets, wi);
    const float dielectric = fresnel_dielectric(cos_i, sheet.ior).reflectance;
    const float diffuse = 1.0f - sheet.specular;
    if (passes) {
        *pdf = sheet.specular_passes_rate * visible + sheet.passes_rate * INV_PI * o;
        return (value * (1.0f - dielectric) + diffuse * sheet.passes * INV_PI * o) * base.color;
    }
    *pdf = sheet.specular_rate * visible + sheet.diffuse_rate * INV_PI * o;
    const float tint = PRINCIPLED(SPEC_TINT), share = diffuse * (1.0f - sheet.passes);
    return value * ((Spectrum)((1.0f - tint) * dielectric) + tint * tinted_fresnel(base.hue, cos_i, sheet.ior)) +
           principled_diffuse(scene, material, uv, base, wi.z, o, cos_o, sheet.roughness, share, share);
}

INLINE bool sheet_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u, float v,
                         float pick, int channel, BsdfSample *sample)
{
    const Sheet sheet = sheet_at(scene, material, uv);
    const float specular = sheet.specular_rate + sheet.specular_passes_rate;
    const bool passes = pick < specular ? pick >= sheet.specular_rate : pick >= specular + sheet.diffuse_rate;
    const float side = wi.z > 0.0f ? 1.0f : -1.0f;
    float3 wo = cosine_direction(u, v);
    if (pick < specular) {
        const Facets facets = sheet_facets(&sheet, passes);
        const float3 m = sample_visible_normal(&facets, side * wi, u, v);
        wo = 2.0f * dot_of(side * wi, m) * m - side * wi;
        if (passes && dot_of((float3)(wo.x, wo.y, -wo.z), m) >= 0.0f) /* as in the value */
            return false;
    }
    if (wi.z == 0.0f || wo.z <= 0.0f)
        return false;
    if (passes)
        wo.z = -wo.z;
    wo *= side;
    float pdf;
    const Spectrum value = sheet_value(scene, material, uv, wi, wo, channel, &pdf);
    return pdf > 0.0f && pdf < INFINITY && scattered_sample(sample, wo, value / pdf, pdf, 1.0f);
}

#endif
#endif
