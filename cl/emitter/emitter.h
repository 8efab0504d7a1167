/* Light: the environment behind everything, and what next-event estimation samples. */
#ifndef CLVOL_EMITTER_H
#define CLVOL_EMITTER_H
#include "core/sampling.h"

INLINE float3 emitter_value(__global const Emitter *emitter)
{
    return (float3)(emitter->value[0], emitter->value[1], emitter->value[2]);
}

/* Radiance of the environment seen along `direction`, and the density with which next-event
   estimation would have chosen that direction.  There is at most one environment, the first emitter. */
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
INLINE float3 environment(const Scene *scene, float3 direction, float *pdf)
{
    __global const Emitter *emitter = scene->emitters;
#if CLVOL_HAS_ENVMAP
    *pdf = emitter->select_pdf * envmap_pdf(scene, direction);
    return envmap_radiance(scene, direction);
#else
    *pdf = emitter->select_pdf * INV_FOUR_PI;
    return emitter_value(emitter);
#endif
}
#endif

#if CLVOL_NEE
typedef struct {
    float3 direction; /* towards the light */
    float distance;
    float3 value; /* light arriving, over the probability of this choice */
    float pdf;    /* of the direction, choice of light included; 0: no other way to find it (no MIS) */
} LightSample;

INLINE LightSample sample_light(const Scene *scene, float3 from, float choice, float u, float v)
{
    uint index = 0;
    __global const Emitter *emitter = scene->emitters;
    while (index + 1 < scene->render->emitters && choice >= emitter->select_pdf) {
        choice -= emitter->select_pdf;
        ++index, ++emitter;
    }
    LightSample light;
    light.distance = INFINITY;
    light.pdf = 0.0f;
    if (CLVOL_HAS_DIRECTIONAL && emitter->kind == EMITTER_DIRECTIONAL) {
        light.direction = -(float3)(emitter->vector[0], emitter->vector[1], emitter->vector[2]);
        light.value = emitter_value(emitter) / emitter->select_pdf;
        return light;
    }
    if (CLVOL_HAS_POINT && emitter->kind == EMITTER_POINT) {
        const float3 to = (float3)(emitter->vector[0], emitter->vector[1], emitter->vector[2]) - from;
        light.distance = length(to);
        light.direction = to / light.distance;
        light.value = emitter_value(emitter) / (emitter->select_pdf * light.distance * light.distance);
        return light;
    }
#if CLVOL_HAS_ENVMAP
    light.direction = envmap_sample(scene, u, v, &light.pdf);
    light.pdf *= emitter->select_pdf;
    light.value = light.pdf > 0.0f ? envmap_radiance(scene, light.direction) / light.pdf : (float3)(0.0f);
#elif CLVOL_HAS_CONSTANT
    light.direction = sphere_direction(u, v);
    light.pdf = emitter->select_pdf * INV_FOUR_PI;
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
