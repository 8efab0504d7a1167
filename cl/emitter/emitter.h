/* Light: the environment behind everything, and what next-event estimation samples. */
#ifndef CLVOL_EMITTER_EMITTER_H
#define CLVOL_EMITTER_EMITTER_H
#include "core/sampling.h"
#include "core/scene.h"
#include "emitter/area.h"
#include "emitter/envmap.h"
#include "emitter/light_sample.h"
#include "emitter/spot.h"

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
/* The light that the uniform number `pick` chooses, and in `pick` what is left of it, uniform again.  Emitters
   after the first hold the lower part of the unit interval, the weakest lowest, where floats are finest; the first
   has what is above them. */
INLINE __global const Emitter *choose_emitter(const Scene *scene, float *pick)
{
    const uint count = scene->render->emitters;
    uint lower = 1, upper = count;
    while (lower < upper) {
        const uint middle = (lower + upper) >> 1;
        if (scene->emitters[middle].cdf > *pick)
            upper = middle;
        else
            lower = middle + 1;
    }
    __global const Emitter *emitter = scene->emitters + (lower < count ? lower : 0);
    const float left = (*pick - (emitter->cdf - emitter->select_pdf)) / emitter->select_pdf;
    *pick = clamp_to(left, 0.0f, 0x1.fffffep-1f);
    return emitter;
}

/* One direction towards one light; `pick`, u and v are uniform in [0, 1). */
INLINE LightSample sample_light(const Scene *scene, float3 from, float pick, float u, float v)
{
    __global const Emitter *emitter = choose_emitter(scene, &pick);
    LightSample light;
    light.distance = INFINITY;
    light.pdf = 0.0f;
    light.primitive = NO_PRIMITIVE;
#if CLVOL_HAS_AREA
    if (emitter->kind == EMITTER_AREA) {
        sample_area(scene, emitter, from, pick, u, v, &light);
        return light;
    }
#endif
    if (CLVOL_HAS_SPOT && emitter->kind == EMITTER_SPOT) {
        sample_spot(emitter, from, &light);
        return light;
    }
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
