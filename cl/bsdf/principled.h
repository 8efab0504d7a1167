/* What both principled BSDFs share (Burley 2012 and 2015), as in Mitsuba 3. */
#ifndef CLVOL_BSDF_PRINCIPLED_H
#define CLVOL_BSDF_PRINCIPLED_H
#if CLVOL_BSDF_PRINCIPLED || CLVOL_BSDF_PRINCIPLED_GLASS || CLVOL_BSDF_PRINCIPLED_THIN
#include "bsdf/fresnel.h"
#include "bsdf/microfacet.h"
#include "bsdf/sample.h"

/* A number of the material, PRINCIPLED_<name>, at a point. */
INLINE float principled_number(const Scene *scene, __global const Material *material, float2 uv, int name)
{
    __global const float *row = scene->material_tables + material->table + 2 * name;
    if (CLVOL_HAS_TEXTURES && row[1] >= 0.0f)
        return texture_value(scene, (int)row[1], uv).x;
    return row[0];
}
#define PRINCIPLED(name) principled_number(scene, material, uv, PRINCIPLED_##name)

/* The base colour, and its hue: the colour for a luminance of 1. */
typedef struct {
    Spectrum color, hue;
} Base;

INLINE Base principled_base(const Scene *scene, __global const Material *material, float2 uv, int channel)
{
    float3 rgb = load_vector(material->reflectance);
    if (CLVOL_HAS_TEXTURES && material->reflectance_texture >= 0)
        rgb = texture_value(scene, material->reflectance_texture, uv);
    const float luminance = dot_of(rgb, (float3)(0.212671f, 0.715160f, 0.072169f));
    Base base;
    base.color = to_spectrum(rgb, channel);
    base.hue = luminance > 0.0f ? base.color / luminance : (Spectrum)(1.0f);
    return base;
}

INLINE Facets principled_facets(float roughness, float anisotropic)
{
    const float square = roughness * roughness, aspect = sqrt_of(1.0f - 0.9f * anisotropic);
    Facets facets;
    facets.distribution = DISTRIBUTION_GGX;
    facets.alpha_u = max_of(square / aspect, 1e-3f);
    facets.alpha_v = max_of(square * aspect, 1e-3f);
    return facets;
}

INLINE float fifth_power(float x) { return x * x * (x * x) * x; }

INLINE float schlick_weight(float cosine) { return fifth_power(clamp_to(1.0f - cosine, 0.0f, 1.0f)); }

/* How much of white is mixed into the reflectance at normal incidence: by the angle in the thinner medium. */
INLINE float schlick_of(float cos_i, float ior)
{
    const float eta = cos_i >= 0.0f ? ior : 1.0f / ior;
    if (eta > 1.0f)
        return schlick_weight(abs_of(cos_i));
    return schlick_weight(sqrt_of(max_of(1.0f - (1.0f - cos_i * cos_i) / (eta * eta), 0.0f)));
}

INLINE Spectrum schlick_fresnel(Spectrum normal, float weight) { return normal + weight * ((Spectrum)(1.0f) - normal); }

/* Schlick's reflectance of a dielectric that has the hue of the base. */
INLINE Spectrum tinted_fresnel(Spectrum hue, float cos_i, float ior)
{
    const float root = (ior - 1.0f) / (ior + 1.0f); /* the same from both sides */
    return schlick_fresnel(root * root * hue, schlick_of(cos_i, ior));
}

/* Diffuse reflection with retroreflection, the flatter one that stands for scattering below, and sheen, times
   cos theta_o; `d`: the cosine between either direction and the half vector.  Sheen is multiplied by `sheen_share`, the
   others by `share`. */
INLINE Spectrum principled_diffuse(const Scene *scene, __global const Material *material, float2 uv, Base base, float i,
                                   float o, float d, float roughness, float share, float sheen_share)
{
    const float out = schlick_weight(o), in = schlick_weight(i);
    const float bright = 2.0f * roughness * d * d;
    const float rough = (1.0f - 0.5f * in) * (1.0f - 0.5f * out) + bright * (out + in + out * in * (bright - 1.0f));
    const float flattened = lerp(1.0f, 0.5f * bright, out) * lerp(1.0f, 0.5f * bright, in);
    const float flat = 1.25f * (flattened * (1.0f / (o + i) - 0.5f) + 0.5f);
    const float sheen = PRINCIPLED(SHEEN) * sheen_share * schlick_weight(abs_of(d));
    const float tint = PRINCIPLED(SHEEN_TINT);
    return o * (share * INV_PI * lerp(rough, flat, PRINCIPLED(FLATNESS)) * base.color +
                sheen * ((Spectrum)(1.0f - tint) + tint * base.hue));
}

#endif
#endif
