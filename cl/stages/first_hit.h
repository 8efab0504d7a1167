/* What pictures show beside radiance: where a camera path first scatters, at a surface or in a medium. */
#ifndef CLVOL_STAGES_FIRST_HIT_H
#define CLVOL_STAGES_FIRST_HIT_H
#if CLVOL_FIRST_HIT
#if CLVOL_HAS_SURFACES
#include "bsdf/sample.h"
#include "geometry/surface.h"
#endif
#include "core/scene.h"

/* As three channels; a path that follows one of them stands for the sum of three paths. */
INLINE float3 to_rgb(Spectrum s, int channel)
{
#if CLVOL_SPECTRUM == 3
    return s;
#elif CLVOL_ONE_CHANNEL_PER_PATH
    return (float3)(channel == 0 ? 3.0f * s : 0.0f, channel == 1 ? 3.0f * s : 0.0f, channel == 2 ? 3.0f * s : 0.0f);
#else
    return (float3)(s);
#endif
}

/* Keeps what is shown, by the path's weight, so that every technique shows the same: colours by that of each
   channel, the rest by the mean of the channels. */
INLINE void record_weighted(const Scene *scene, uint slot, float3 p, float3 normal, Spectrum albedo)
{
    const Spectrum beta = path_beta(scene, slot) * path_sample_weight(scene, slot);
    const float weight = spectrum_signed_mean(beta);
#if CLVOL_HAS_PARALLEL_RAYS
    const float depth = dot_of(p - load_vector(scene->render->camera_eye), load_vector(scene->render->camera_forward));
#else
    const float depth = length(p - load_vector(scene->render->camera_eye));
#endif
    set_path_depth(scene, slot, weight * depth);
    set_path_normal(scene, slot, weight * normal);
    set_path_albedo(scene, slot, to_rgb(beta * albedo, (int)path_channel(scene, slot)));
    set_path_position(scene, slot, weight * p);
    set_path_met(scene, slot, weight);
}

#if CLVOL_HAS_MEDIA
/* A collision has no normal. */
INLINE void first_collision(const Scene *scene, uint slot, float3 p, Spectrum albedo)
{
    if (path_bounce(scene, slot) == 0)
        record_weighted(scene, slot, p, (float3)(0.0f), albedo);
}
#endif

#if CLVOL_HAS_SURFACES
/* The colour of the base, where there is one under a coat; else of what is mirrored. */
INLINE void first_surface(const Scene *scene, uint slot, const Surface *surface, __global const Material *material)
{
    const int channel = (int)path_channel(scene, slot);
    if (path_bounce(scene, slot) > 0)
        return;
    const bool base = material->kind == MATERIAL_DIFFUSE || material->kind == MATERIAL_PLASTIC ||
                      material->kind == MATERIAL_ROUGH_PLASTIC;
    const Spectrum albedo = base ? reflectance(scene, material, surface->uv, channel)
                                 : specular_reflectance(scene, material, surface->uv, channel);
    record_weighted(scene, slot, surface->p, surface->n, albedo);
}
#endif

#endif
#endif
