/* What a light sends to a point if nothing is in its way, about, as the choice among lights wants to know it. */
#ifndef CLVOL_EMITTER_IRRADIANCE_H
#define CLVOL_EMITTER_IRRADIANCE_H
#include "core/scene.h"
#include "emitter/light_sample.h"
#include "emitter/projector.h"
#include "emitter/spot.h"

/* Lights that a point tells apart, the strongest: the first and those that come last. */
INLINE uint weighed_lights(const Scene *scene)
{
    return scene->render->emitters < MOST_WEIGHED_LIGHTS ? scene->render->emitters : MOST_WEIGHED_LIGHTS;
}

INLINE uint weighed_light(const Scene *scene, uint row)
{
    return row == 0 ? 0 : row + scene->render->emitters - weighed_lights(scene);
}

/* The row of a light among those, -1 of any other. */
INLINE int weighed_row(const Scene *scene, uint light)
{
    const int row = (int)(light + weighed_lights(scene)) - (int)scene->render->emitters;
    return light == 0 ? 0 : (row > 0 ? row : -1);
}

INLINE bool is_environment(__global const Emitter *emitter)
{
    return emitter->kind == EMITTER_CONSTANT || emitter->kind == EMITTER_ENVMAP;
}

/* Direction from p to the middle of a light that is no environment, and how far that is. */
INLINE float3 light_middle(__global const Emitter *emitter, float3 p, float *distance)
{
    *distance = INFINITY;
    if (emitter->kind == EMITTER_DIRECTIONAL)
        return -load_vector(emitter->vector);
#if CLVOL_HAS_SUN
    if (emitter->kind == EMITTER_SUN)
        return -load_vector(emitter->vector);
#endif
    const float3 to = load_vector(emitter->position) - p;
    *distance = max_of(sqrt_of(dot_of(to, to)), 1e-18f);
    return to / *distance;
}

/* Integral over all directions of the radiance that arrives at p from the light, mean over channels.  An area light
   counts as a point that shows the area it shows from its mean normal, and of a closed one the mean. */
INLINE float light_irradiance(__global const Emitter *emitter, float3 p)
{
    const float value = mean3(emitter_value(emitter));
    if (is_environment(emitter))
        return value * (4.0f * PI);
    if (emitter->kind == EMITTER_DIRECTIONAL)
        return value;
#if CLVOL_HAS_SUN
    if (emitter->kind == EMITTER_SUN)
        return value * emitter->area;
#endif
    float distance;
    const float3 d = light_middle(emitter, p, &distance);
    const float square = distance * distance;
#if CLVOL_HAS_PROJECTOR
    float2 uv;
    if (emitter->kind == EMITTER_PROJECTOR)
        return value * picture_share(emitter) * projector_share(emitter, -d, &uv) / square;
#endif
#if CLVOL_HAS_SPOT_TEXTURE
    if (emitter->kind == EMITTER_SPOT)
        return value * picture_share(emitter) * spot_falloff(emitter, -d) / square;
#endif
    if (emitter->kind == EMITTER_SPOT)
        return value * spot_falloff(emitter, -d) / square;
    if (emitter->kind == EMITTER_POINT)
        return value / square;
    const float3 normal = load_vector(emitter->vector);
    const float flat_ = sqrt_of(dot_of(normal, normal)),
                shows = max_of(-dot_of(normal, d), 0.0f) + 0.25f * (1.0f - flat_);
    return value * emitter->area * shows / (square + emitter->area);
}

#endif
