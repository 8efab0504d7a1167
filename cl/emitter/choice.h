/* Which light next-event estimation samples: by power, or by what each is expected to bring to the point that it is
   sampled from.

   light_choice "contribution" mixes two tables: a quarter of the choices goes by power and a uniform share, which are
   in the table of emitters, three quarters by irradiance times the cached transmittance of the strongest lights.  The
   probability depends on the point only, so that MIS finds it again from there. */
#ifndef CLVOL_EMITTER_CHOICE_H
#define CLVOL_EMITTER_CHOICE_H
#include "core/scene.h"
#if CLVOL_LIGHT_CHOICE
#include "emitter/irradiance.h"
#include "emitter/light_cache.h"
#endif

/* The light whose interval of the emitters' table holds `pick`, and in `pick` what is left of it, uniform again.
   Emitters after the first hold the lower part of the unit interval, the weakest lowest, where floats are finest; the
   first has what is above them. */
INLINE uint choose_by_table(const Scene *scene, float *pick)
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
    const uint light = lower < count ? lower : 0;
    __global const Emitter *emitter = scene->emitters + light;
    const float left = (*pick - (emitter->cdf - emitter->select_pdf)) / emitter->select_pdf;
    *pick = clamp_to(left, 0.0f, 0x1.fffffep-1f);
    return light;
}

#if CLVOL_LIGHT_CHOICE
/* Of choices that go by the table.  A power of two keeps the fineness of small numbers. */
#define TABLE_SHARE 0.25f

/* What a light is expected to bring to p.  A sky is found by scattering as well, and needs sampling less: not at all
   where it is uniform. */
INLINE float expected_light(const Scene *scene, uint light, float3 p)
{
    __global const Emitter *emitter = scene->emitters + light;
    float expected = light_irradiance(emitter, p);
    if (is_environment(emitter))
        expected *= 0.5f;
#if CLVOL_LIGHT_CACHE
    float distance;
    const float3 d = light_middle(emitter, p, &distance);
    expected *= cached_transmittance(scene, light, p, d, distance);
#endif
    return expected;
}

/* Of a light that is expected to bring `own` of the `sum`. */
INLINE float mixed_probability(const Scene *scene, uint light, float own, float sum)
{
    const float listed = scene->emitters[light].select_pdf;
    return sum > 0.0f && sum < INFINITY ? TABLE_SHARE * listed + (1.0f - TABLE_SHARE) * (own / sum) : listed;
}

/* Probability that `light` is sampled from `from`. */
INLINE float light_probability(const Scene *scene, uint light, float3 from)
{
    float sum = 0.0f, own = 0.0f;
    for (uint row = 0; row < weighed_lights(scene); ++row) {
        const uint other = weighed_light(scene, row);
        const float expected = expected_light(scene, other, from);
        sum += expected;
        own = other == light ? expected : own;
    }
    return mixed_probability(scene, light, own, sum);
}

/* The light that the uniform number `pick` chooses for `from`, with what probability, and in `pick` what is left of it. */
INLINE uint choose_light(const Scene *scene, float3 from, float *pick, float *chosen)
{
    float expected[MOST_WEIGHED_LIGHTS], sum = 0.0f;
    const uint count = weighed_lights(scene);
    for (uint row = 0; row < count; ++row) {
        expected[row] = expected_light(scene, weighed_light(scene, row), from);
        sum += expected[row];
    }
    const bool weighs = sum > 0.0f && sum < INFINITY;
    uint light;
    if (!weighs || *pick < TABLE_SHARE) {
        *pick *= weighs ? 1.0f / TABLE_SHARE : 1.0f;
        light = choose_by_table(scene, pick);
    } else {
        float left = (*pick - TABLE_SHARE) * (sum / (1.0f - TABLE_SHARE));
        uint row = 0;
        for (; row + 1 < count && left >= expected[row]; ++row)
            left -= expected[row];
        *pick = clamp_to(left / expected[row], 0.0f, 0x1.fffffep-1f);
        light = weighed_light(scene, row);
    }
    const int row = weighed_row(scene, light);
    *chosen = mixed_probability(scene, light, row < 0 ? 0.0f : expected[row], sum);
    return light;
}
#else
INLINE float light_probability(const Scene *scene, uint light, float3 from)
{
    return scene->emitters[light].select_pdf;
}
INLINE uint choose_light(const Scene *scene, float3 from, float *pick, float *chosen)
{
    const uint light = choose_by_table(scene, pick);
    *chosen = scene->emitters[light].select_pdf;
    return light;
}
#endif

#endif
