/* Projectors (Mitsuba's): a point that throws a picture, as a perspective camera would see it.  On any plane across the
   axis the picture is as bright all over as it says, times pi at a distance of one. */
#ifndef CLVOL_EMITTER_PROJECTOR_H
#define CLVOL_EMITTER_PROJECTOR_H
#if CLVOL_HAS_PROJECTOR
#include "core/scene.h"
#include "emitter/light_sample.h"
#include "emitter/slide.h"
#if CLVOL_HAS_TEXTURES
#include "texture/texture.h"
#endif

/* Intensity along d, a unit vector, over that along the axis where the picture is even: 1 / cos³, as its square meters
   lie askew and farther; 0 beside the picture.  `uv`: where in the picture. */
INLINE float projector_share(__global const Emitter *emitter, float3 d, float2 *uv)
{
    const float along = dot_of(d, load_vector(emitter->vector));
    if (!(along > 0.0f))
        return 0.0f;
    const float2 at = slide_point(emitter, d, along);
    const float cosine = emitter->cutoff_angle, sine = emitter->beam_width;
    *uv = 0.5f + (float2)(cosine * at.x + sine * at.y, emitter->area * (cosine * at.y - sine * at.x));
    const bool inside = uv->x >= 0.0f && uv->x <= 1.0f && uv->y >= 0.0f && uv->y <= 1.0f;
    return inside ? 1.0f / (along * along * along) : 0.0f;
}

INLINE void sample_projector(const Scene *scene, __global const Emitter *emitter, float3 from, LightSample *light)
{
    const float3 to = load_vector(emitter->position) - from;
    light->distance = sqrt_of(dot_of(to, to));
    light->direction = to / light->distance;
    float2 uv = (float2)(0.0f);
    const float share = projector_share(emitter, -light->direction, &uv);
    light->value = emitter_value(emitter) * (share / (light->chosen * light->distance * light->distance));
#if CLVOL_HAS_TEXTURES
    if (share > 0.0f && emitter->first > 0)
        light->value *= texture_value(scene, emitter->first - 1, uv);
#endif
}
#endif

#endif
