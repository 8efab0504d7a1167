/* Spot lights: a point light whose intensity falls in a straight line with the angle off its axis, from all at the
   beam's width to nothing at the cutoff (Mitsuba's). */
#ifndef CLVOL_EMITTER_SPOT_H
#define CLVOL_EMITTER_SPOT_H
#include "core/scene.h"
#include "emitter/light_sample.h"
#if CLVOL_HAS_SPOT_TEXTURE
#include "emitter/slide.h"
#include "texture/texture.h"
#endif

/* Share of the intensity that travels along d, a unit vector. */
INLINE float spot_falloff(__global const Emitter *emitter, float3 d)
{
    const float3 axis = (float3)(emitter->vector[0], emitter->vector[1], emitter->vector[2]);
    const float3 across = cross_of(axis, d);
    const float angle = atan2(sqrt_of(dot_of(across, across)), dot_of(axis, d)); /* a cosine is blind near the axis */
    if (angle <= emitter->beam_width)
        return 1.0f;
    if (!(angle < emitter->cutoff_angle))
        return 0.0f;
    return (emitter->cutoff_angle - angle) / (emitter->cutoff_angle - emitter->beam_width);
}

INLINE void sample_spot(__global const Emitter *emitter, float3 from, LightSample *light)
{
    const float3 to = (float3)(emitter->position[0], emitter->position[1], emitter->position[2]) - from;
    light->distance = sqrt_of(dot_of(to, to));
    light->direction = to / light->distance;
    light->value = emitter_value(emitter) *
                   (spot_falloff(emitter, -light->direction) / (light->chosen * light->distance * light->distance));
}

#if CLVOL_HAS_SPOT_TEXTURE
/* Multiplies a sample of the spot by its texture, which lies on the plane one before it (slide in
   clvol/tables/textures.py). */
INLINE void project_texture(const Scene *scene, __global const Emitter *emitter, LightSample *light)
{
    if (emitter->first == 0)
        return;
    const float along = -dot_of(light->direction, load_vector(emitter->vector));
    if (along > 0.0f) /* else it is dark already */
        light->value *= texture_value(scene, emitter->first - 1, slide_point(emitter, -light->direction, along));
}
#endif

#endif
