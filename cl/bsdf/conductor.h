/* Smooth metal: one delta lobe. */
#ifndef CLVOL_BSDF_CONDUCTOR_H
#define CLVOL_BSDF_CONDUCTOR_H
#if CLVOL_BSDF_CONDUCTOR
#include "bsdf/fresnel.h"
#include "bsdf/sample.h"

INLINE bool conductor_sample(const Scene *scene, __global const Material *material, float2 uv, float3 wi, int channel,
                             BsdfSample *sample)
{
    const Spectrum weight = specular_reflectance(scene, material, uv, channel) *
                            conductor_reflectance(METAL_AT(scene, material, uv), wi.z, channel);
    return delta_sample(sample, mirrored(wi), weight, 1.0f) && wi.z > 0.0f;
}

#endif
#endif
