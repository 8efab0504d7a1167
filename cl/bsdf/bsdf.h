/* The BSDF of a material: dispatches to the kinds that the scene has.

   CLVOL_BSDF_<kind> is 1 for those; of the others nothing is compiled.  A mask is the `opacity` of a material, which
   the caller decides first; all here is what is left of the surface then.  One-sided kinds reflect on the side of +z
   alone: the caller picks the side's material and turns z (material_transmits), and of a mixture one part before. */
#ifndef CLVOL_BSDF_BSDF_H
#define CLVOL_BSDF_BSDF_H
#include "bsdf/blend.h"
#include "bsdf/conductor.h"
#include "bsdf/dielectric.h"
#include "bsdf/diffuse.h"
#include "bsdf/kinds.h"
#include "bsdf/plastic.h"
#include "bsdf/principled_solid.h"
#include "bsdf/principled_thin.h"
#include "bsdf/rough_conductor.h"
#include "bsdf/rough_dielectric.h"
#include "bsdf/rough_plastic.h"
#include "bsdf/sample.h"

/* Share of the surface that is there at all. */
INLINE float material_opacity(const Scene *scene, __global const Material *material, float2 uv)
{
    if (CLVOL_HAS_TEXTURES && material->opacity_texture >= 0)
        return material->opacity * texture_value(scene, material->opacity_texture, uv).x;
    return material->opacity;
}

/* What a ray that goes straight on keeps: the mask's holes, and what is left passes straight on itself. */
INLINE Spectrum null_transmission(const Scene *scene, __global const Material *material, float2 uv, float cos_i,
                                  int channel)
{
    if (IS_BSDF(material, NULL))
        return (Spectrum)(1.0f);
    const float opacity = material_opacity(scene, material, uv);
#if CLVOL_BSDF_THIN_DIELECTRIC
    if (IS_BSDF(material, THIN_DIELECTRIC))
        return (Spectrum)(1.0f - opacity) + opacity * thin_dielectric_transmission(scene, material, uv, cos_i, channel);
#endif
    return (Spectrum)(1.0f - opacity);
}

/* f |cos theta_o| and the pdf, in solid angle, with which bsdf_sample draws wo; 0 and 0 for delta lobes. */
INLINE Spectrum bsdf_value(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float3 wo,
                           int channel, float *pdf)
{
#if CLVOL_BSDF_DIFFUSE
    if (IS_BSDF(material, DIFFUSE))
        return diffuse_value(scene, material, uv, wi, wo, channel, pdf);
#endif
#if CLVOL_BSDF_ROUGH_DIELECTRIC
    if (IS_BSDF(material, ROUGH_DIELECTRIC))
        return rough_dielectric_value(scene, material, uv, wi, wo, channel, pdf);
#endif
#if CLVOL_BSDF_ROUGH_CONDUCTOR
    if (IS_BSDF(material, ROUGH_CONDUCTOR))
        return rough_conductor_value(scene, material, uv, wi, wo, channel, pdf);
#endif
#if CLVOL_BSDF_PLASTIC
    if (IS_BSDF(material, PLASTIC))
        return plastic_value(scene, material, uv, wi, wo, channel, pdf);
#endif
#if CLVOL_BSDF_ROUGH_PLASTIC
    if (IS_BSDF(material, ROUGH_PLASTIC))
        return rough_plastic_value(scene, material, uv, wi, wo, channel, pdf);
#endif
#if CLVOL_BSDF_PRINCIPLED || CLVOL_BSDF_PRINCIPLED_GLASS
    if (IS_BSDF(material, PRINCIPLED) || IS_BSDF(material, PRINCIPLED_GLASS))
        return solid_value(scene, material, uv, wi, wo, channel, pdf);
#endif
#if CLVOL_BSDF_PRINCIPLED_THIN
    if (IS_BSDF(material, PRINCIPLED_THIN))
        return sheet_value(scene, material, uv, wi, wo, channel, pdf);
#endif
    *pdf = 0.0f;
    return (Spectrum)(0.0f);
}

/* Draws wo from three numbers: u, v for the direction and `pick` for the lobe.  False: absorbed, and the sample
   holds nothing. */
INLINE bool bsdf_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, float u, float v,
                        float pick, int channel, BsdfSample *sample)
{
#if CLVOL_BSDF_DIFFUSE
    if (IS_BSDF(material, DIFFUSE))
        return diffuse_sample(scene, material, uv, wi, u, v, channel, sample);
#endif
#if CLVOL_BSDF_DIELECTRIC
    if (IS_BSDF(material, DIELECTRIC))
        return dielectric_sample(scene, material, uv, wi, pick, channel, sample);
#endif
#if CLVOL_BSDF_THIN_DIELECTRIC
    if (IS_BSDF(material, THIN_DIELECTRIC))
        return thin_dielectric_sample(scene, material, uv, wi, pick, channel, sample);
#endif
#if CLVOL_BSDF_ROUGH_DIELECTRIC
    if (IS_BSDF(material, ROUGH_DIELECTRIC))
        return rough_dielectric_sample(scene, material, uv, wi, u, v, pick, channel, sample);
#endif
#if CLVOL_BSDF_CONDUCTOR
    if (IS_BSDF(material, CONDUCTOR))
        return conductor_sample(scene, material, uv, wi, channel, sample);
#endif
#if CLVOL_BSDF_ROUGH_CONDUCTOR
    if (IS_BSDF(material, ROUGH_CONDUCTOR))
        return rough_conductor_sample(scene, material, uv, wi, u, v, channel, sample);
#endif
#if CLVOL_BSDF_PLASTIC
    if (IS_BSDF(material, PLASTIC))
        return plastic_sample(scene, material, uv, wi, u, v, pick, channel, sample);
#endif
#if CLVOL_BSDF_ROUGH_PLASTIC
    if (IS_BSDF(material, ROUGH_PLASTIC))
        return rough_plastic_sample(scene, material, uv, wi, u, v, pick, channel, sample);
#endif
#if CLVOL_BSDF_PRINCIPLED || CLVOL_BSDF_PRINCIPLED_GLASS
    if (IS_BSDF(material, PRINCIPLED) || IS_BSDF(material, PRINCIPLED_GLASS))
        return solid_sample(scene, material, uv, wi, u, v, pick, channel, sample);
#endif
#if CLVOL_BSDF_PRINCIPLED_THIN
    if (IS_BSDF(material, PRINCIPLED_THIN))
        return sheet_sample(scene, material, uv, wi, u, v, pick, channel, sample);
#endif
    delta_sample(sample, -wi, (Spectrum)(1.0f), 1.0f); /* null */
    sample->passes = true;
    return true;
}

#endif
