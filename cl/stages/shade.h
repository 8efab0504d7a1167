/* Handles what happened to a path: it escaped to the environment, collided in a medium, or met a surface.

   A collision is absorbed or scattered; a scattering draws one next-event ray and the next direction.
   The directional densities of phase function, or BSDF, and light sampling are weighted by the power heuristic
   (METHODS §6). */
#ifndef CLVOL_STAGES_SHADE_H
#define CLVOL_STAGES_SHADE_H
#include "tracking/probability.h"

/* Weight of a path below which absorption is sampled (absorption "mixed").  On cloud.xml, with
   next-event estimation, 1/2 was 1.4 times as efficient as never sampling it and 1.9 times as always. */
#define MIXED_WEIGHT 0.5f

INLINE void shade_escape(const Scene *scene, uint slot)
{
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
    if (CLVOL_HIDE_EMITTERS && path_bounce(scene, slot) == 0)
        return;
#if CLVOL_HAS_MAX_DEPTH
    if (scene->render->max_depth == 0)
        return;
#endif
    float light_pdf;
    const float3 rgb = environment(scene, path_ray(scene, slot).d, &light_pdf);
    Spectrum radiance = get_beta(scene, slot) * to_spectrum(rgb, (int)path_channel_or_zero(scene, slot));
#if CLVOL_MIS
    const float pdf = path_pdf(scene, slot);
    if (pdf > 0.0f)
        radiance *= mis_weight(pdf, light_pdf);
#endif
    set_radiance(scene, slot, get_radiance(scene, slot) + radiance);
#endif
}

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

#if CLVOL_NEE
/* Queues a shadow ray that brings `value` along if nothing is in its way. */
INLINE void queue_shadow(const Scene *scene, uint group, uint slot, float3 from, const LightSample *light, Spectrum value)
{
    set_path_shadow_x(scene, slot, light->direction.x);
    set_path_shadow_y(scene, slot, light->direction.y);
    set_path_shadow_z(scene, slot, light->direction.z);
#if CLVOL_HAS_POINT || CLVOL_HAS_SPOT || CLVOL_HAS_AREA
    set_path_shadow_distance(scene, slot, light->distance);
#endif
#if CLVOL_HAS_SURFACES
    set_path_shadow_origin_x(scene, slot, from.x);
    set_path_shadow_origin_y(scene, slot, from.y);
    set_path_shadow_origin_z(scene, slot, from.z);
#endif
    set_shadow(scene, slot, value);
    queue_push(scene, group, QUEUE_SHADOW, slot);
}
#endif

#if CLVOL_FIRST_HIT
#include "stages/first_hit.h"
#endif
#if CLVOL_HAS_SURFACES
#include "stages/surface_scatter.h"
#endif

#if CLVOL_HAS_SCATTERING
/* Absorption at a collision (METHODS §2): by event, by weight, or by weight as long as the path's weight
   is worth following and by event below.  Each multiplies the expected weight by the albedo.  By event, a path
   of several channels chooses between scattering and absorption as it does between events of its walk. */
INLINE bool survives_absorption(const Scene *scene, uint slot, SampleKey key, uint interval, Spectrum albedo,
                                Spectrum *beta)
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
#if CLVOL_HAS_TRANSMISSION
        weight *= path_eta_squared(scene, slot);
#endif
        if (CLVOL_ABSORPTION == ABSORPTION_MIXED)
            survival = min_of(1.0f, weight * (1.0f / MIXED_WEIGHT));
        else
            survival = weight > 0.0f ? 1.0f : 0.0f;
    }
    if (survival < 1.0f) {
        const uint4 k = decision_block(render_seed(scene), key, BLOCK_WALK, interval);
        if (!choose_event(k.y, survival, 1.0f - survival))
            return false;
        if (CLVOL_ABSORPTION == ABSORPTION_MIXED)
            *beta *= 1.0f / survival;
    }
    return true;
}

/* Next-event estimation: queues a shadow ray towards one light. */
INLINE void next_event(const Scene *scene, uint group, uint slot, SampleKey key, __global const Medium *medium,
                              float3 p, float3 wo, Spectrum beta)
{
#if CLVOL_NEE
    if (!medium->sample_emitters)
        return;
    const uint4 k = decision_block(render_seed(scene), key, BLOCK_LIGHT, 0);
    const LightSample light =
        sample_light(scene, p, uniform_below_one(k.x), uniform_below_one(k.y), uniform_below_one(k.z));
    const float pdf = phase_pdf(scene, medium, wo, light.direction);
    const float weight = light.pdf > 0.0f ? mis_weight(light.pdf, pdf) : 1.0f;
    const Spectrum value = beta * to_spectrum(light.value, (int)path_channel_or_zero(scene, slot)) * (pdf * weight);
    if (!(spectrum_max(value) > 0.0f))
        return;
#if CLVOL_BOUNDARY_WORDS > 0
    set_shadow_inside(scene, slot, get_inside(scene, slot));
#endif
    queue_shadow(scene, group, slot, p, &light, value);
#endif
}

/* The path goes on from p; returns false when it ends there. */
INLINE bool scatter(const Scene *scene, uint group, uint slot, SampleKey key, __global const Medium *medium,
                           Spectrum beta)
{
    key.bounce += 1;
    if (depth_is_reached(scene, slot, key.bounce, beta))
        return false;
    set_path_bounce(scene, slot, key.bounce); /* also numbers the shadow ray's random numbers */
    const Ray ray = path_ray(scene, slot);
    next_event(scene, group, slot, key, medium, ray.o, ray.d, beta);
    const uint4 k = decision_block(render_seed(scene), key, BLOCK_DIRECTION, 0);
    if (key.bounce > scene->render->rr_depth) {
        float survival = spectrum_max(beta);
#if CLVOL_HAS_TRANSMISSION
        survival *= path_eta_squared(scene, slot);
#endif
        survival = min_of(1.0f, survival);
        if (survival < 1.0f && !(uniform_float(k.z) < survival)) /* uniform_float may round to 1 */
            return false;
        beta /= survival;
    }
    float pdf;
    const float3 wi = phase_sample(scene, medium, ray.d, uniform_below_one(k.x), uniform_below_one(k.y),
                                   uniform_float(k.w), &pdf);
#if CLVOL_MIS
    set_path_pdf(scene, slot, medium->sample_emitters ? pdf : 0.0f);
#endif
    set_path_direction(scene, slot, wi);
    set_beta(scene, slot, beta);
    record_weight(scene, slot, spectrum_max(beta));
    reset_ray(scene, slot);
    return true;
}
#endif

#if CLVOL_HAS_MEDIA
/* Returns false when the path ends at the collision. */
INLINE bool shade_collision(const Scene *scene, uint group, uint slot)
{
#if CLVOL_HAS_MANY_MEDIA
    const int number = path_medium(scene, slot);
#else
    const int number = 0;
#endif
    __global const Medium *medium = scene->media + number;
    const uint interval = path_stretch_or_zero(scene, slot) * scene->render->media + (uint)number;
    const float3 p = path_ray(scene, slot).o;
    const int channel = (int)path_channel_or_zero(scene, slot);
    Spectrum beta = get_beta(scene, slot);
#if CLVOL_EMISSION_AT_COLLISIONS /* of overlapping media: their walks do not know which collision counts */
    if (!CLVOL_HAS_MAX_DEPTH || scene->render->max_depth > 0)
        set_radiance(scene, slot, get_radiance(scene, slot) + beta * medium_source(scene, medium, p, channel));
#endif
#if CLVOL_FIRST_HIT
    first_collision(scene, slot, p, medium_albedo(scene, medium, p, channel));
#endif
#if CLVOL_HAS_SCATTERING
    const SampleKey key = path_key(scene, slot);
    if (!survives_absorption(scene, slot, key, interval, medium_albedo(scene, medium, p, channel), &beta))
        return false;
    return scatter(scene, group, slot, key, medium, beta);
#else
    return false;
#endif
}
#endif

INLINE void shade(const Scene *scene, uint group, uint slot)
{
    const uint event = path_event(scene, slot);
    bool goes_on = false;
    if (event == EVENT_ESCAPE)
        shade_escape(scene, slot);
#if CLVOL_HAS_MEDIA
    else if (event == EVENT_COLLISION)
        goes_on = shade_collision(scene, group, slot);
#endif
#if CLVOL_HAS_SURFACES
    else if (event == EVENT_SURFACE)
        goes_on = shade_surface(scene, group, slot);
#endif
    queue_push(scene, group, goes_on ? QUEUE_INTERSECT : QUEUE_GENERATE, slot);
}

#endif
