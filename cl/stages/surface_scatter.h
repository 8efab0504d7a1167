/* What happens to a path at a surface: it gathers the light of a lamp, passes on, is absorbed, or scatters by the
   surface's BSDF. */
#ifndef CLVOL_STAGES_SURFACE_SCATTER_H
#define CLVOL_STAGES_SURFACE_SCATTER_H
#if CLVOL_HAS_SURFACES
#include "bsdf/bsdf.h"
#include "emitter/area.h"
#include "emitter/emitter.h"
#include "geometry/surface.h"
#include "path/draws.h"
#include "path/ray.h"
#include "path/reset.h"
#include "stages/bend.h"
#include "stages/bounce.h"
#include "stages/boundary.h"
#include "stages/first_hit.h"
#include "stages/side.h"

/* What `intersect` found. */
INLINE Hit path_hit(const Scene *scene, uint slot)
{
    Hit hit;
    hit.t = path_hit_t(scene, slot);
    hit.primitive = path_hit_primitive(scene, slot);
    hit.u = path_hit_u(scene, slot);
    hit.v = path_hit_v(scene, slot);
    return hit;
}

#if CLVOL_HAS_PASSABLE
/* The ray goes straight on behind the surface: no scattering, and no bounce. */
INLINE bool pass_on(const Scene *scene, uint slot, Ray ray, const Hit *hit, const Surface *surface)
{
    Inside inside = path_inside(scene, slot);
    cross_boundary(scene->shapes + surface->shape, surface->ng, ray.d, &inside);
    set_path_inside(scene, slot, inside);
    set_path_after_t(scene, slot, hit->t);
    set_path_after_primitive(scene, slot, hit->primitive);
    const uint segment = path_segment(scene, slot) + 1;
    set_path_segment(scene, slot, segment);
    if (segment < MOST_PASSED)
        return true;
    set_path_exhausted(scene, slot, path_exhausted(scene, slot) + 1);
    return false;
}
#endif

#if CLVOL_HAS_AREA
/* Light of a lamp that the path has run into. */
INLINE void gather_lamp(const Scene *scene, uint slot, Ray ray, const Hit *hit, const Surface *surface)
{
#if CLVOL_HAS_MAX_DEPTH
    if (scene->render->max_depth == 0)
        return;
#endif
    const float3 rgb = area_radiance(scene, surface, ray.d);
    Spectrum radiance = path_beta(scene, slot) * to_spectrum(rgb, (int)path_channel(scene, slot));
#if CLVOL_MIS
    const float pdf = path_pdf(scene, slot);
    if (pdf > 0.0f)
        radiance *= mis_weight(pdf, area_pdf(scene, surface, ray.o, ray.d, hit->t));
#endif
    set_path_radiance(scene, slot, path_radiance(scene, slot) + radiance);
}
#endif

/* Next-event estimation from a surface: whether it made a shadow ray, towards one light. */
INLINE bool surface_next_event(const Scene *scene, uint slot, const Draws *draws, const Surface *surface,
                               const Side *side, float3 wi, Spectrum beta)
{
#if CLVOL_NEE
    if (material_is_smooth(side->material))
        return false;
    const uint4 k = drawn_block(scene, draws, BLOCK_LIGHT);
    LightSample light = sample_light(scene, surface->p, uniform_below_one(k.x), uniform_below_one(k.y),
                                     uniform_below_one(k.z));
    float pdf;
    const int channel = (int)path_channel(scene, slot);
    const Spectrum f = bsdf_value(scene, side->material, surface->uv, on_side(side, wi),
                                  on_side(side, to_local(surface, light.direction)), channel, &pdf);
    const float weight = light.pdf > 0.0f ? mis_weight(light.pdf, pdf) : 1.0f;
#if CLVOL_BSDF_BENT
    beta *= bend_share(side, surface, light.direction);
#endif
    Spectrum value = beta * f * to_spectrum(light.value, channel) * weight;
    if (spectrum_max(value) == 0.0f)
        return false;
#if CLVOL_LIGHT_CACHE
    const float through = cached_transmittance(scene, light.number, surface->p, light.direction, light.distance);
    if (!traces_shadow_ray(scene, k.w, WORTH_TRACING_AT_SURFACES, through, &value))
        return false;
#endif
    Inside inside = path_inside(scene, slot);
    cross_boundary(scene->shapes + surface->shape, surface->ng, light.direction, &inside);
    set_path_shadow_inside(scene, slot, inside);
    const float3 start = spawn_point(surface, light.direction);
    light.distance -= dot_of(start - surface->p, light.direction); /* now from there */
    make_shadow_ray(scene, slot, start, &light, value);
    return true;
#else
    return false;
#endif
}

/* The path goes on along the sampled direction; false where roulette ends it. */
INLINE bool leave_surface(const Scene *scene, uint slot, const Draws *draws, const Surface *surface, float3 d,
                          float pdf, float eta, Spectrum beta)
{
    const float eta_squared = CLVOL_HAS_TRANSMISSION ? path_eta_squared(scene, slot) * eta * eta : 1.0f;
    set_path_eta_squared(scene, slot, eta_squared);
    const float weight = spectrum_max(beta) * eta_squared;
    if (weight == 0.0f) /* not so for NaN, which is to be seen */
        return false;
    const float survival = roulette_survival(scene, draws->key.bounce + 1, weight, true);
    if (survival < 1.0f && !survives_roulette(drawn_block(scene, draws, BLOCK_DIRECTION).z, survival, &beta))
        return false;
    Inside inside = path_inside(scene, slot);
    cross_boundary(scene->shapes + surface->shape, surface->ng, d, &inside);
    set_path_inside(scene, slot, inside);
    set_path_origin(scene, slot, spawn_point(surface, d));
    set_path_direction(scene, slot, d);
    set_path_beta(scene, slot, beta);
    set_path_pdf(scene, slot, pdf);
    reset_ray(scene, slot);
    return true;
}

#if CLVOL_BSDF_BENT
#define VARIED
#else
#define VARIED const
#endif

/* Returns false when the path ends at the surface; `shadow_ray`: whether it made one. */
INLINE bool shade_surface(const Scene *scene, uint slot, const Draws *draws, bool *shadow_ray)
{
    const Ray ray = path_ray(scene, slot);
    const Hit hit = path_hit(scene, slot);
    VARIED Surface surface = hit_surface(scene, ray, &hit);
#if CLVOL_HAS_VOLUME_TEXTURES
    Scene there = *scene;
    there.texture_point = surface.p;
    scene = &there;
#endif
    __global const Shape *shape = scene->shapes + surface.shape;
#if CLVOL_DEPTH_PICTURE /* instead of radiance; from the near plane on, as in Mitsuba */
    set_path_radiance(scene, slot, (Spectrum)(hit.t));
#endif
#if CLVOL_HAS_AREA && CLVOL_HIDE_EMITTERS /* the camera sees through lamps, as in Mitsuba */
    if (shape->emitter >= 0 && path_bounce(scene, slot) == 0)
        return pass_on(scene, slot, ray, &hit, &surface);
#endif
#if CLVOL_HAS_AREA
    if (shape->emitter >= 0)
        gather_lamp(scene, slot, ray, &hit, &surface);
#endif
    VARIED float3 wi = to_local(&surface, -ray.d);
    Side side;
    if (!side_of(scene, shape, wi, &side))
        return false;
    const uint4 k = drawn_block(scene, draws, BLOCK_SURFACE);
#if CLVOL_BSDF_BLEND
    float pick = uniform_float(k.w);
    if (!choose_side(scene, surface.uv, wi, &pick, &side))
        return false;
#define PICK pick
#else
#define PICK uniform_float(k.w)
#endif
#if CLVOL_BSDF_BENT
    bend_surface(scene, &surface, &side, &wi);
#endif
#if CLVOL_DEPTH_PICTURE
#if CLVOL_FIRST_HIT
    first_surface(scene, slot, &surface, side.material);
#endif
    return false;
#endif
#if CLVOL_HAS_PASSABLE
    if (side.material->kind == MATERIAL_NULL)
        return pass_on(scene, slot, ray, &hit, &surface);
    const float opacity = material_opacity(scene, side.material, surface.uv);
    if (opacity < 1.0f && !choose_event(k.x, opacity, 1.0f - opacity))
        return pass_on(scene, slot, ray, &hit, &surface);
#endif
#if CLVOL_HAS_REFLECTION
    BsdfSample sample;
    Spectrum beta = path_beta(scene, slot);
    const bool sampled = bsdf_sample(scene, side.material, surface.uv, on_side(&side, wi), uniform_below_one(k.y),
                                     uniform_below_one(k.z), PICK, (int)path_channel(scene, slot), &sample);
#if CLVOL_HAS_PASSABLE
    if (sampled && sample.passes) {
        set_path_beta(scene, slot, beta * sample.weight);
        return pass_on(scene, slot, ray, &hit, &surface);
    }
#endif
#if CLVOL_FIRST_HIT
    first_surface(scene, slot, &surface, side.material);
#endif
    const uint bounce = draws->key.bounce + 1;
    if (depth_is_reached(scene, slot, bounce, beta))
        return false;
    set_path_bounce(scene, slot, bounce); /* also numbers the shadow ray's random numbers */
    *shadow_ray = surface_next_event(scene, slot, draws, &surface, &side, wi, beta);
    if (!sampled)
        return false;
    const float3 d = unit_of(to_world(&surface, on_side(&side, sample.direction)));
#if CLVOL_BSDF_BENT
    beta *= bend_share(&side, &surface, d);
#endif
    return leave_surface(scene, slot, draws, &surface, d, sample.pdf, sample.eta, beta * sample.weight);
#else
    return false;
#endif
}

#endif
#endif
