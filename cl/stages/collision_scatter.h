/* What happens to a path at a collision in a medium: it gathers the medium's emission, where walks have not, and is
   absorbed or scattered; a scattering draws one next-event ray and the next direction. */
#ifndef CLVOL_STAGES_COLLISION_SCATTER_H
#define CLVOL_STAGES_COLLISION_SCATTER_H
#if CLVOL_HAS_MEDIA
#include "emitter/emitter.h"
#if CLVOL_EMISSION_AT_COLLISIONS
#include "medium/emission.h"
#endif
#if CLVOL_HAS_SCATTERING || CLVOL_FIRST_HIT
#include "medium/albedo.h"
#endif
#include "phase/phase.h"
#include "phase/varied.h"
#if CLVOL_HAS_SCATTERING
#include "stages/bounce.h"
#include "stages/direction_control.h"
#endif
#include "path/draws.h"
#include "path/ray.h"
#include "path/reset.h"
#include "path/weight.h"
#include "stages/first_hit.h"
#include "tracking/probability.h"

/* Weight of a path below which absorption is sampled (absorption "mixed").  On cloud.xml, with
   next-event estimation, 1/2 was 1.4 times as efficient as never sampling it and 1.9 times as always; 0.3 is 1.02 to
   1.07 times as efficient as 1/2 on clouds under a sky, grey or not, and smoke in a room.  Where flights
   gather emission at strata, what a dark medium scatters is most of the noise: with an albedo of 0.3, 1/10 was 1.4
   times as efficient as 1/4, and 1.1 times as never. */
#define MIXED_WEIGHT (FOLLOWED_WEIGHT * (CLVOL_FLIGHT_STRATA > 1 ? 0.1f : 0.3f))

#if CLVOL_HAS_SCATTERING
/* Absorption at a collision (METHODS §2): by event, by weight, or by weight as long as the path's weight
   is worth following and by event below.  Each multiplies the expected weight by the albedo.  By event, a path
   of several channels chooses between scattering and absorption as it does between events of its walk. */
INLINE bool survives_absorption(const Scene *scene, uint slot, const Draws *draws, Spectrum albedo, Spectrum *beta)
{
    float survival = 1.0f;
    if (CLVOL_ABSORPTION == ABSORPTION_SAMPLE) {
#if CLVOL_SPECTRUM == 3
        const float scatters = spectral_rate(*beta, albedo), absorbed = spectral_rate(*beta, 1.0f - albedo);
        survival = scatters > 0.0f ? scatters / (scatters + absorbed) : 0.0f;
        if (survival > 0.0f)
            *beta *= albedo / survival;
#else
        survival = albedo;
#endif
    } else {
        *beta *= albedo;
        float weight = spectrum_max(*beta);
        weight *= path_eta_squared(scene, slot);
        if (CLVOL_ABSORPTION == ABSORPTION_MIXED)
            survival = min_of(1.0f, weight * (1.0f / MIXED_WEIGHT));
        else
            survival = weight > 0.0f ? 1.0f : 0.0f;
    }
    if (survival < 1.0f) {
        if (!choose_event(drawn_block(scene, draws, BLOCK_WALK).y, survival, 1.0f - survival))
            return false;
        if (CLVOL_ABSORPTION == ABSORPTION_MIXED)
            *beta *= 1.0f / survival;
    }
    return true;
}

/* Next-event estimation: whether it made a shadow ray, towards one light. */
INLINE bool next_event(const Scene *scene, uint slot, const Draws *draws, __global const Medium *medium, float3 p,
                       float3 wo, float3 wi, Spectrum beta)
{
#if CLVOL_NEE
    if (!medium->sample_emitters)
        return false;
    const uint4 k = drawn_block(scene, draws, BLOCK_LIGHT);
    const LightSample light = sample_light(scene, p, uniform_below_one(k.x), uniform_below_one(k.y),
                                           uniform_below_one(k.z));
    const float pdf = PHASE_PDF(p, wo, light.direction);
    const float weight = light.pdf > 0.0f ? mis_weight(light.pdf, pdf) : 1.0f;
    const Spectrum unoccluded = beta * to_spectrum(light.value, (int)path_channel(scene, slot));
    Spectrum value = unoccluded * (pdf * weight);
    if (!(spectrum_max(value) > 0.0f))
        return false;
#if CLVOL_LIGHT_CACHE
    const float transmittance = cached_transmittance(scene, light.number, p, light.direction, light.distance);
#if CLVOL_DIRECTION_CONTROL
    if (!(light.pdf > 0.0f) && !(CLVOL_HAS_MAX_DEPTH && draws->key.bounce + 2 >= scene->render->max_depth)) {
        const Spectrum added = unoccluded * direction_control(scene, medium, transmittance, wo, wi, light.direction);
        set_path_radiance(scene, slot, path_radiance(scene, slot) + added);
    }
#endif
    if (!traces_shadow_ray(scene, k.w, WORTH_TRACING_IN_MEDIA, transmittance, &value))
        return false;
#endif
    set_path_shadow_inside(scene, slot, path_inside(scene, slot));
    make_shadow_ray(scene, slot, p, &light, value);
    return true;
#else
    return false;
#endif
}

/* The path goes on from p; returns false when it ends there. */
INLINE bool scatter(const Scene *scene, uint slot, const Draws *draws, __global const Medium *medium, Spectrum beta,
                    bool *shadow_ray)
{
    const uint bounce = draws->key.bounce + 1;
    if (depth_is_reached(scene, slot, bounce, beta))
        return false;
    set_path_bounce(scene, slot, bounce); /* also numbers the shadow ray's random numbers */
    const Ray ray = path_ray(scene, slot);
    const uint4 k = drawn_block(scene, draws, BLOCK_DIRECTION);
    float pdf;
    const float3 wi = PHASE_SAMPLE(ray.o, ray.d, uniform_below_one(k.x), uniform_below_one(k.y), uniform_float(k.w),
                                   &pdf);
    *shadow_ray = next_event(scene, slot, draws, medium, ray.o, ray.d, wi, beta);
    const float weight = spectrum_max(beta) * path_eta_squared(scene, slot);
    const float survival = roulette_survival(scene, bounce, weight, false);
    if (survival < 1.0f && !survives_roulette(k.z, survival, &beta))
        return false;
    set_path_pdf(scene, slot, medium->sample_emitters ? pdf : 0.0f);
    set_path_direction(scene, slot, wi);
    set_path_beta(scene, slot, beta);
    record_weight(scene, slot, spectrum_max(beta));
    reset_ray(scene, slot);
    return true;
}
#endif

/* Returns false when the path ends at the collision; `shadow_ray`: whether it made one. */
INLINE bool shade_collision(const Scene *scene, uint slot, const Draws *draws, bool *shadow_ray)
{
    __global const Medium *medium = scene->media + path_medium(scene, slot);
    const float3 p = path_ray(scene, slot).o;
    const int channel = (int)path_channel(scene, slot);
    Spectrum beta = path_beta(scene, slot);
#if CLVOL_EMISSION_AT_COLLISIONS /* of overlapping media: their walks do not know which collision counts */
    if (!CLVOL_HAS_MAX_DEPTH || scene->render->max_depth > 0)
        set_path_radiance(scene, slot, path_radiance(scene, slot) + beta * medium_source(scene, medium, p, channel));
#endif
#if CLVOL_FIRST_HIT
    first_collision(scene, slot, p, medium_albedo(scene, medium, p, channel));
#endif
#if CLVOL_HAS_SCATTERING
    if (!survives_absorption(scene, slot, draws, medium_albedo(scene, medium, p, channel), &beta))
        return false;
    return scatter(scene, slot, draws, medium, beta, shadow_ray);
#else
    return false;
#endif
}

#endif
#endif
