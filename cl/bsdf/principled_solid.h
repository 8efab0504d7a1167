/* The principled BSDF: diffuse, metallic and specular lobes, a clear coat, and refraction where it transmits. */
#ifndef CLVOL_BSDF_PRINCIPLED_SOLID_H
#define CLVOL_BSDF_PRINCIPLED_SOLID_H
#if CLVOL_BSDF_PRINCIPLED || CLVOL_BSDF_PRINCIPLED_GLASS
#include "bsdf/principled.h"

#define COAT_ALPHA 0.25f /* of the shadowing of the clear coat, whatever its gloss */

/* How often each lobe is sampled: not normalised.  The last two are shared out by the Fresnel reflectance of the facet. */
typedef struct {
    float roughness, metallic;
    float opaque, glass; /* of what is not metal: diffuse, or refracting */
    float diffuse, coat, specular;
    Facets facets;
} Solid;

INLINE Solid solid_at(const Scene *scene, __global const Material *material, float2 uv, bool front)
{
    Solid solid;
    solid.roughness = PRINCIPLED(ROUGHNESS), solid.metallic = PRINCIPLED(METALLIC);
    const float transmits = PRINCIPLED(SPEC_TRANS);
    solid.opaque = (1.0f - solid.metallic) * (1.0f - transmits);
    solid.glass = (1.0f - solid.metallic) * transmits;
    solid.diffuse = front ? solid.opaque * PRINCIPLED(DIFFUSE_RATE) : 0.0f;
    solid.coat = front ? 0.25f * PRINCIPLED(CLEARCOAT) * PRINCIPLED(THIRD_RATE) : 0.0f;
    solid.specular = front ? PRINCIPLED(SPECULAR_RATE) : 1.0f;
    solid.facets = principled_facets(solid.roughness, PRINCIPLED(ANISOTROPIC));
    return solid;
}

/* Of samples of the specular lobe, those that are reflected by a facet of reflectance F. */
INLINE float reflected_share(const Solid *solid, bool front, float reflectance)
{
    return front ? 1.0f - solid->glass * (1.0f - reflectance) : reflectance;
}

INLINE float coat_roughness(const Scene *scene, __global const Material *material, float2 uv)
{
    return lerp(0.1f, 1e-3f, PRINCIPLED(CLEARCOAT_GLOSS));
}

/* Density of the coat's facets, GTR of exponent 1, per solid angle and area. */
INLINE float coat_density(float alpha, float3 m)
{
    const float square = alpha * alpha;
    return (square - 1.0f) / (PI * log(square) * (1.0f + (square - 1.0f) * m.z * m.z));
}

INLINE float3 sample_coat_normal(float alpha, float u, float v)
{
    const float square = alpha * alpha;
    const float cos2 = clamp_to((1.0f - pow(square, 1.0f - v)) / (1.0f - square), 0.0f, 1.0f);
    const float r = sqrt_of(1.0f - cos2);
    const float2 turn = cos_sin_turn(u);
    return (float3)(r * turn.x, r * turn.y, sqrt_of(cos2));
}

INLINE float coat_shadowing(float3 w)
{
    const float a = COAT_ALPHA * COAT_ALPHA, cos2 = w.z * w.z;
    return 2.0f / (1.0f + sqrt_of(1.0f + a * (1.0f - cos2) / cos2));
}

/* Reflectance of a facet from the front: metal, and dielectric with or without the base's hue. */
INLINE Spectrum solid_fresnel(const Scene *scene, __global const Material *material, float2 uv, const Solid *solid,
                              Base base, float cos_i, float dielectric)
{
    const float metal = solid->metallic, tint = PRINCIPLED(SPEC_TINT);
    return metal * schlick_fresnel(base.color, schlick_of(cos_i, material->ior)) +
           (1.0f - metal) *
               ((Spectrum)((1.0f - tint) * dielectric) + tint * tinted_fresnel(base.hue, cos_i, material->ior));
}

INLINE Spectrum solid_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float3 wo,
                            int channel, float *pdf)
{
    *pdf = 0.0f;
    const bool front = wi.z > 0.0f, reflects = wi.z * wo.z > 0.0f;
    const float ior = material->ior, eta = front ? ior : 1.0f / ior;
    float3 m = wi + (reflects ? 1.0f : eta) * wo;
    const float square = dot_of(m, m);
    const Solid solid = solid_at(scene, material, uv, front);
    const float total = solid.diffuse + solid.coat + solid.specular;
    if (wi.z * wo.z == 0.0f || square == 0.0f || total <= 0.0f || (!(front && reflects) && solid.glass <= 0.0f))
        return (Spectrum)(0.0f);
    m *= with_sign(1.0f / sqrt_of(square), m.z);
    const float cos_i = dot_of(wi, m), cos_o = dot_of(wo, m);
    const Base base = principled_base(scene, material, uv, channel);
    const float dielectric = fresnel_dielectric(cos_i, ior).reflectance;
    const float share = reflected_share(&solid, front, dielectric);
    const bool meets = cos_i * wi.z > 0.0f && cos_o * wo.z > 0.0f; /* facets are seen from the surface's side */
    const float density = meets ? microfacet_density(&solid.facets, m) : 0.0f;
    const float value = density * shadowing_over_cos(&solid.facets, wi) * shadowing(&solid.facets, wo);
    const float visible = density * visibility_over_cos(&solid.facets, wi);
    if (!reflects) {
        const float root = cos_i + eta * cos_o;
        const float jacobian = abs_of(cos_i * cos_o) / (root * root);
        *pdf = solid.specular * (1.0f - share) / total * visible * eta * eta * jacobian;
        return solid.glass * (1.0f - dielectric) * value * jacobian * sqrt(base.color);
    }
    *pdf = 0.25f * solid.specular * share / total * visible;
    if (!front)
        return (Spectrum)(0.25f * solid.glass * dielectric * value);
    Spectrum found = 0.25f * value * solid_fresnel(scene, material, uv, &solid, base, cos_i, dielectric);
    const float coat = PRINCIPLED(CLEARCOAT);
    if (coat > 0.0f && meets) {
        const float d = coat_density(coat_roughness(scene, material, uv), m);
        *pdf += solid.coat / total * d * m.z / (4.0f * cos_o);
        const float fresnel = lerp(0.04f, 1.0f, schlick_of(cos_i, ior));
        found += (Spectrum)(0.25f * coat * fresnel * d * coat_shadowing(wi) * coat_shadowing(wo) * wo.z);
    }
    *pdf += solid.diffuse / total * INV_PI * wo.z;
    return found + principled_diffuse(scene, material, uv, base, wi.z, wo.z, cos_o, solid.roughness, solid.opaque,
                                      solid.opaque > 0.0f ? 1.0f - solid.metallic : 0.0f);
}

INLINE bool solid_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u, float v,
                         float pick, int channel, BsdfSample *sample)
{
    const bool front = wi.z > 0.0f;
    const Solid solid = solid_at(scene, material, uv, front);
    const float total = solid.diffuse + solid.coat + solid.specular;
    if (wi.z == 0.0f || (!front && solid.glass <= 0.0f))
        return false;
    float3 wo;
    float eta = 1.0f;
    const float place = pick * total - solid.diffuse - solid.coat;
    if (place < -solid.coat) {
        wo = cosine_direction(u, v);
    } else if (place < 0.0f) {
        const float3 m = sample_coat_normal(coat_roughness(scene, material, uv), u, v);
        if (dot_of(wi, m) <= 0.0f)
            return false;
        wo = 2.0f * dot_of(wi, m) * m - wi;
    } else {
        const float3 m = sample_visible_normal(&solid.facets, front ? wi : -wi, u, v);
        const float cos_m = dot_of(wi, m);
        const Fresnel fresnel = fresnel_dielectric(cos_m, material->ior);
        const float inverse = 1.0f / fresnel.eta;
        if (place < solid.specular * (1.0f - reflected_share(&solid, front, fresnel.reflectance))) {
            wo = (cos_m * inverse + fresnel.cos_t) * m - inverse * wi;
            eta = fresnel.eta;
        } else {
            wo = 2.0f * cos_m * m - wi;
        }
    }
    if ((wo.z * wi.z > 0.0f) != (eta == 1.0f))
        return false;
    float pdf;
    const Spectrum value = solid_value(scene, material, uv, wi, wo, channel, &pdf);
    return pdf > 0.0f && pdf < INFINITY && scattered_sample(sample, wo, value / pdf, pdf, eta);
}

#endif
#endif
