/* Fresnel reflectance of unpolarised light. */
#ifndef CLVOL_BSDF_FRESNEL_H
#define CLVOL_BSDF_FRESNEL_H
#include "core/scene.h"
#if CLVOL_HAS_METAL_TEXTURES
#include "texture/texture.h"
#endif

typedef struct {
    float reflectance;
    float cos_t; /* of the refracted direction with the normal, of the other sign than cos_i; 0: total reflection */
    float eta;   /* index of the far side over that of the near side */
} Fresnel;

/* Boundary of relative index `ior` (below the normal over above it), met at cos_i: negative from below. */
INLINE Fresnel fresnel_dielectric(float cos_i, float ior)
{
    Fresnel result;
    result.eta = cos_i >= 0.0f ? ior : 1.0f / ior;
    const float inverse = cos_i >= 0.0f ? 1.0f / ior : ior;
    const float c = abs_of(cos_i);
    const float t = sqrt_of(max_of(1.0f - (1.0f - c * c) * inverse * inverse, 0.0f));
    const float s = (c - result.eta * t) / (c + result.eta * t);
    const float p = (t - result.eta * c) / (t + result.eta * c);
    result.cos_t = cos_i >= 0.0f ? -t : t;
    /* 0/0 where the indices match or the ray grazes */
    result.reflectance = ior == 1.0f ? 0.0f : (c == 0.0f ? 1.0f : 0.5f * (s * s + p * p));
    return result;
}

/* A pane of two parallel boundaries: R + T² R + T² R³ + … = 2 R / (1 + R). */
INLINE float thin_reflectance(float cos_i, float ior)
{
    const float r = fresnel_dielectric(abs_of(cos_i), ior).reflectance;
    return 2.0f * r / (1.0f + r);
}

/* Metal of complex index eta - i k, with a + i b = sqrt_of((eta - i k)² - sin²) (Born and Wolf, §14.4).  a² is the
   difference of almost equal numbers where the metal absorbs much, and exactly 0 for eta = 0: it is taken from the
   product a b = eta k there. */
INLINE float fresnel_conductor(float cos_i, float eta, float k)
{
    const float cos2 = cos_i * cos_i, sin2 = 1.0f - cos2;
    const float real = eta * eta - k * k - sin2, imaginary = 2.0f * eta * k;
    const float modulus = sqrt_of(real * real + imaginary * imaginary);
    const float a2 = real > 0.0f ? 0.5f * (modulus + real)
                                 : 0.5f * imaginary * imaginary / max_of(modulus - real, 1e-30f);
    const float x = modulus + cos2, y = 2.0f * cos_i * sqrt_of(a2);
    const float s = (x - y) / max_of(x + y, 1e-30f);
    const float z = modulus * cos2 + sin2 * sin2, w = y * sin2;
    const float p = s * (z - w) / max_of(z + w, 1e-30f);
    return 0.5f * (s + p);
}

/* A metal's indices may be textures: METAL_AT names it, and where on it if so. */
#if CLVOL_HAS_METAL_TEXTURES
#define METAL_AT(scene, material, uv) scene, material, uv

/* One of the indices; negative: that of texture -1 - index. */
INLINE Spectrum metal_index(const Scene *scene, __global const float *index, float2 uv, int channel)
{
    return material_color(scene, index, index[0] < 0.0f ? (int)(-1.0f - index[0]) : -1, uv, channel);
}

INLINE Spectrum conductor_reflectance(const Scene *scene, __global const Material *material, float2 uv, float cos_i,
                                      int channel)
{
    const Spectrum eta = metal_index(scene, material->eta, uv, channel);
    const Spectrum k = metal_index(scene, material->k, uv, channel);
#else
#define METAL_AT(scene, material, uv) material

INLINE Spectrum conductor_reflectance(__global const Material *material, float cos_i, int channel)
{
    const Spectrum eta = to_spectrum(load_vector(material->eta), channel);
    const Spectrum k = to_spectrum(load_vector(material->k), channel);
#endif
#if CLVOL_SPECTRUM == 3
    return (float3)(fresnel_conductor(cos_i, eta.x, k.x), fresnel_conductor(cos_i, eta.y, k.y),
                    fresnel_conductor(cos_i, eta.z, k.z));
#else
    return fresnel_conductor(cos_i, eta, k);
#endif
}

#endif
