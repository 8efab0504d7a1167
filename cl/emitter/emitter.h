/* Light: the environment behind everything, and what next-event estimation samples. */
#ifndef CLVOL_EMITTER_EMITTER_H
#define CLVOL_EMITTER_EMITTER_H
#include "core/sampling.h"
#include "core/scene.h"
#include "emitter/area.h"
#include "emitter/choice.h"
#include "emitter/envmap.h"
#include "emitter/light_sample.h"
#include "emitter/projector.h"
#include "emitter/spot.h"
#include "emitter/sun.h"

/* Radiance of the environment seen along `direction`, and the density with which next-event
   estimation would have chosen that direction from `from`.  There is at most one environment: the first emitter, or
   behind all that are chosen among if it is uniform and not alone. */
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
INLINE float3 environment(const Scene *scene, float3 from, float3 direction, float *pdf)
{
#if CLVOL_HAS_ENVMAP
    *pdf = light_probability(scene, 0, from) * envmap_pdf(scene, direction);
    return envmap_radiance(scene, direction);
#elif CLVOL_SKY_APART
    *pdf = 0.0f;
    return emitter_value(scene->emitters + scene->render->emitters);
#else
    *pdf = light_probability(scene, 0, from) * INV_FOUR_PI;
    return emitter_value(scene->emitters);
#endif
}
#endif

#if CLVOL_NEE
/* One direction towards one light; `pick`, u and v are uniform in [0, 1). */
INLINE LightSample sample_light(const Scene *scene, float3 from, float pick, float u, float v)
{
    LightSample light;
    light.number = choose_light(scene, from, &pick, &light.chosen);
    __global const Emitter *emitter = scene->emitters + light.number;
    light.distance = INFINITY;
    light.pdf = 0.0f;
    light.primitive = NO_PRIMITIVE;
#if CLVOL_HAS_AREA
    if (emitter->kind == EMITTER_AREA) {
        sample_area(scene, emitter, from, pick, u, v, &light);
#if CLVOL_HAS_AREA_TEXTURE
        show_texture(scene, emitter, from, u, v, &light);
#endif
        return light;
    }
#endif
    if (CLVOL_HAS_SPOT && emitter->kind == EMITTER_SPOT) {
        sample_spot(emitter, from, &light);
#if CLVOL_HAS_SPOT_TEXTURE
        project_texture(scene, emitter, &light);
#endif
        return light;
    }
#if CLVOL_HAS_PROJECTOR
    if (emitter->kind == EMITTER_PROJECTOR) {
        sample_projector(scene, emitter, from, &light);
        return light;
    }
#endif
#if CLVOL_HAS_SUN
    if (emitter->kind == EMITTER_SUN) {
        sample_sun(emitter, u, v, &light);
        return light;
    }
#endif
    if (CLVOL_HAS_DIRECTIONAL && emitter->kind == EMITTER_DIRECTIONAL) {
        light.direction = -(float3)(emitter->vector[0], emitter->vector[1], emitter->vector[2]);
        light.value = emitter_value(emitter) / light.chosen;
        return light;
    }
    if (CLVOL_HAS_POINT && emitter->kind == EMITTER_POINT) {
        const float3 to = load_vector(emitter->position) - from;
        light.distance = length(to);
        light.direction = to / light.distance;
        light.value = emitter_value(emitter) / (light.chosen * light.distance * light.distance);
        return light;
    }
#if CLVOL_HAS_ENVMAP
    light.direction = envmap_sample(scene, u, v, &light.pdf);
    light.pdf *= light.chosen;
    light.value = light.pdf > 0.0f ? envmap_radiance(scene, light.direction) / light.pdf : (float3)(0.0f);
#elif CLVOL_HAS_CONSTANT && !CLVOL_SKY_APART
    light.direction = sphere_direction(u, v);
    light.pdf = light.chosen * INV_FOUR_PI;
    light.value = emitter_value(emitter) / light.pdf;
#endif
    return light;
}
#endif

/* Power heuristic for one sample of each of two densities. */
INLINE float mis_weight(float pdf, float other)
{
    const float ratio = other / pdf;
    return 1.0f / (1.0f + ratio * ratio);
}

#endif
