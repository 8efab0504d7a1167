/* What scatterings at surfaces and in media have in common: the depth they may reach, roulette, and shadow rays. */
#ifndef CLVOL_STAGES_BOUNCE_H
#define CLVOL_STAGES_BOUNCE_H
#include "emitter/light_cache.h"
#if CLVOL_NEE
#include "emitter/light_sample.h"
#endif
#include "core/random.h"
#include "core/scene.h"
#include "path/weight.h"

/* Whether the scattering numbered `bounce` is one too many; what it would have carried on is counted. */
INLINE bool depth_is_reached(const Scene *scene, uint slot, uint bounce, Spectrum beta)
{
#if CLVOL_HAS_MAX_DEPTH
    if (bounce >= scene->render->max_depth) {
        set_path_cut(scene, slot, path_cut(scene, slot) + 1);
        set_path_cut_energy(scene, slot, path_cut_energy(scene, slot) + spectrum_mean(beta));
        return true;
    }
#endif
    return false;
}

/* With which probability a path survives roulette at the scattering numbered `bounce` (METHODS §6).  `weight`: what it
   would carry on; NaN goes on, to be seen.  What weighs less than some least weight survives in proportion, and weighs
   as much then: 1 from rr_depth on.  Before, with roulette "weight", it is a half at surfaces from the second
   scattering on, since the first makes whole pixels dark; media have absorption "mixed".  In a room with smoke (albedos
   of 0.7 and 0.8) that was 1.5 times as efficient as following all, and a least weight of 1 at once 1.2 times. */
INLINE float roulette_survival(const Scene *scene, uint bounce, float weight, bool at_surface)
{
    const float early = CLVOL_ROULETTE == ROULETTE_WEIGHT && at_surface && bounce > 1 ? 0.5f : 0.0f;
    const float least = bounce > scene->render->rr_depth ? FOLLOWED_WEIGHT : early;
    return weight < least ? weight / least : 1.0f;
}

/* Roulette of a path whose survival is less than certain, by the random number k. */
INLINE bool survives_roulette(uint k, float survival, Spectrum *beta)
{
    if (!(uniform_float(k) < survival)) /* uniform_float may round to 1 */
        return false;
    *beta /= survival;
    return true;
}

#if CLVOL_LIGHT_CACHE
/* Shares of what is typical below which a shadow ray may be left out, from media and from surfaces, whose paths are less
   noisy; the least transmittance that it is expected to have, so that what it brings is bounded where the cache is
   wrong; and how rarely it is traced at most, so that a picture in which nothing is typical, as of the far side of a
   sharp phase function, is not black by chance. */
#define WORTH_TRACING_IN_MEDIA 0.2f
#define WORTH_TRACING_AT_SURFACES 0.02f
#define LEAST_EXPECTED 0.01f
#define LEAST_TRACED 0x1p-6f

/* Roulette of a shadow ray by what it will bring, as the cache of lights has it: the more it falls short of what is
   typical, the rarer it is traced.  `transmittance`: the cached one.  Its lower bound keeps what a ray brings bounded where
   the cache is wrong. */
INLINE bool traces_shadow_ray(const Scene *scene, uint k, float worth, float transmittance, Spectrum *value)
{
    const float expected = spectrum_max(*value) * max_of(transmittance, LEAST_EXPECTED);
    const float enough = worth * scene->light_cache->typical;
    if (!(expected < enough))
        return true;
    const float traced = max_of(expected / enough, LEAST_TRACED);
    if (!(uniform_float(k) < traced))
        return false;
    *value /= traced;
    return true;
}
#endif

#if CLVOL_NEE
/* Makes a shadow ray that brings `value` along if nothing is in its way. */
INLINE void make_shadow_ray(const Scene *scene, uint slot, float3 from, const LightSample *light, Spectrum value)
{
    set_path_shadow_direction(scene, slot, light->direction);
    set_path_shadow_distance(scene, slot, light->distance);
    set_path_shadow_origin(scene, slot, from);
#if CLVOL_HAS_AREA
    set_path_shadow_primitive(scene, slot, light->primitive);
#endif
    set_path_shadow_light(scene, slot, value);
    set_path_shadow_rays(scene, slot, path_shadow_rays(scene, slot) + 1);
}
#endif

#endif
