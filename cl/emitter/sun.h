/* A sun: a far disk of even radiance, the cone of directions about an axis, which a horizon may cut.  Its light is added
   to that of the environment behind it.

   Directions are drawn uniformly within the whole cone.  Whether one is within is told from its distance to the axis,
   |d - axis|^2 = 2 (1 - cos): a cosine is blind for disks as small as the sun's. */
#ifndef CLVOL_EMITTER_SUN_H
#define CLVOL_EMITTER_SUN_H
#if CLVOL_HAS_SUN
#include "core/sampling.h"
#include "core/scene.h"
#include "emitter/choice.h"
#include "emitter/light_sample.h"

/* Number of the scene's one sun (clvol/tables/lights.py). */
INLINE uint sun_number(const Scene *scene) { return scene->render->emitters - 1u; }

/* Whether a direction towards it is above the horizon; always, if that is far below the disk. */
INLINE bool sun_has_risen(__global const Emitter *sun, float3 d)
{
    return dot_of(d, load_vector(sun->position)) >= 0.0f;
}

/* Radiance from the direction d, a unit vector. */
INLINE float3 sun_radiance(__global const Emitter *sun, float3 d)
{
    const float3 off = d + load_vector(sun->vector);
    const bool within = dot_of(off, off) <= sun->area * (1.0f / PI);
    return within && sun_has_risen(sun, d) ? emitter_value(sun) : (float3)(0.0f);
}

/* Density with which next-event estimation draws a direction within the disk. */
INLINE float sun_pdf(const Scene *scene, float3 from)
{
    const uint number = sun_number(scene);
    return light_probability(scene, number, from) / scene->emitters[number].area;
}

INLINE void sample_sun(__global const Emitter *sun, float u, float v, LightSample *light)
{
    const float h = u * sun->area * (0.5f / PI); /* 1 - cos of the angle to the axis */
    const float sine = sqrt_of(h * (2.0f - h));
    const float2 turn = cos_sin_turn(v);
    light->direction = to_frame(-load_vector(sun->vector), sine * turn.x, sine * turn.y, 1.0f - h);
    light->pdf = light->chosen / sun->area;
    light->value = sun_has_risen(sun, light->direction) ? emitter_value(sun) / light->pdf : (float3)(0.0f);
}

#endif
#endif
