/* What every BSDF shares: the sampled direction, and the colours of a material.

   Directions are in the local frame of the surface (z = shading normal) and point away from it: wi to where the path
   came from, wo to where it goes.  Values are f |cos theta_o| for radiance that travels from wo to wi. */
#ifndef CLVOL_BSDF_SAMPLE_H
#define CLVOL_BSDF_SAMPLE_H
#include "core/scene.h"
#include "texture/texture.h"

#define INV_PI 0.31830988618379067154f

typedef struct {
    float3 direction; /* wo */
    Spectrum weight;  /* f |cos theta_o| / pdf; refraction scales radiance by 1 / eta² */
    float pdf;        /* in solid angle; 0 for a delta lobe */
    float eta;        /* index of the side entered over that of the side left; 1 where it reflects */
    bool passes;      /* straight on, which is no scattering */
} BsdfSample;

/* Whether an event of this probability happens; exact for 0 and 1, though `pick` may round to 1. */
INLINE bool happens(float pick, float probability) { return probability >= 1.0f || pick < probability; }

INLINE float3 mirrored(float3 wi) { return (float3)(-wi.x, -wi.y, wi.z); }

/* Direction of density cos theta / pi; never along the horizon, where its pdf would be that of a delta lobe. */
INLINE float3 cosine_direction(float u, float v)
{
    const float r = sqrt_of(u);
    const float2 turn = cos_sin_turn(v);
    return (float3)(r * turn.x, r * turn.y, sqrt_of(max_of(1.0f - u, 0x1p-25f)));
}

INLINE bool delta_sample(BsdfSample *sample, float3 direction, Spectrum weight, float eta)
{
    sample->direction = direction;
    sample->weight = weight;
    sample->pdf = 0.0f;
    sample->eta = eta;
    sample->passes = false;
    return true;
}

INLINE bool scattered_sample(BsdfSample *sample, float3 direction, Spectrum weight, float pdf, float eta)
{
    delta_sample(sample, direction, weight, eta);
    sample->pdf = pdf;
    return pdf > 0.0f;
}

INLINE Spectrum reflectance(const Scene *scene, __global const Material *material, float2 uv, int channel)
{
    return material_color(scene, material->reflectance, material->reflectance_texture, uv, channel);
}

INLINE Spectrum specular_reflectance(const Scene *scene, __global const Material *material, float2 uv, int channel)
{
    return material_color(scene, material->specular, material->specular_texture, uv, channel);
}

INLINE Spectrum specular_transmittance(const Scene *scene, __global const Material *material, float2 uv, int channel)
{
    return material_color(scene, material->transmittance, material->transmittance_texture, uv, channel);
}

#endif
