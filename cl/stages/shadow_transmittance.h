/* Attenuates one next-event ray by everything on its way and adds what arrives. */
#ifndef CLVOL_STAGES_SHADOW_TRANSMITTANCE_H
#define CLVOL_STAGES_SHADOW_TRANSMITTANCE_H
#if CLVOL_NEE
#include "core/sampler.h"
#include "geometry/bvh.h"
#if CLVOL_HAS_PASSABLE
#include "bsdf/bsdf.h"
#include "stages/boundary.h"
#include "stages/side.h"
#endif
#if CLVOL_HAS_AREA
#include "geometry/surface.h"
#endif
#include "stages/legs.h"
#include "stages/media.h"
#include "stages/path.h"
#if CLVOL_HAS_HETEROGENEOUS
#include CLVOL_TRANSMITTANCE_HEADER
#endif
#include "tracking/homogeneous_transmittance.h"

#if CLVOL_HAS_HETEROGENEOUS
CLVOL_WALKED_FIELD(shadow_)
#endif

#if CLVOL_HAS_MEDIA
INLINE Extinction medium_transmittance(const MediumRay *in, uint4 k, Tally *tally)
{
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in->medium))
        return homogeneous_transmittance(in);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    Stream stream = stream_begin(k.z, k.w);
    return estimate_transmittance(in, k.x, &stream, tally);
#endif
}

/* Multiplies the transmittance of all media between `from` and `to`; false once nothing is left, or where a walk stops
   short.  Where the walk has legs behind it, it goes on in the medium where it stopped. */
INLINE bool media_transmittance(const Scene *scene, uint slot, SampleKey key, Ray ray, const Inside *inside, uint stretch,
                                float from, float to, int channel, Tally *tally, Extinction *transmittance)
{
    Walked walked = {0, from, 0.0f};
    uint m = 0;
#if CLVOL_HAS_HETEROGENEOUS
    walked = get_shadow_walked(scene, slot, from);
#if CLVOL_HAS_MANY_MEDIA
    m = walked.leg > 0 ? path_shadow_medium(scene, slot) : 0;
#endif
#endif
    for (; m < (CLVOL_HAS_MANY_MEDIA ? scene->render->media : 1u); ++m, walked.leg = 0, walked.t = from) {
        Span span;
        if (!medium_part(scene, m, ray, inside, walked.t, to, &span))
            continue;
        const uint4 block = decision_block(scene, key, BLOCK_SHADOW, walk_number(scene, stretch, (int)m));
        Ray start = ray;
        start.o = span_point(&span, ray);
        const MediumRay in = part_ray(scene, inside, (int)m, start, span.end - span.start, channel);
        *transmittance *= medium_transmittance(&in, leg_block(block, walked.leg), tally);
        if (extinction_max(*transmittance) == 0.0f) {
            tally->stopped = 0;
            return false;
        }
#if CLVOL_HAS_HETEROGENEOUS
        if (goes_on(walked, tally)) {
            set_shadow_walked(scene, slot, walk_on(walked, span_t(&span), tally->stop_t));
#if CLVOL_HAS_MANY_MEDIA
            set_path_shadow_medium(scene, slot, m);
#endif
            return false;
        }
#endif
    }
    return true;
}
#endif

INLINE Ray shadow_ray(const Scene *scene, uint slot)
{
    Ray ray;
#if CLVOL_HAS_SURFACES
    ray.o = (float3)(path_shadow_origin_x(scene, slot), path_shadow_origin_y(scene, slot), path_shadow_origin_z(scene, slot));
#else
    ray.o = path_ray(scene, slot).o;
#endif
    ray.d = (float3)(path_shadow_x(scene, slot), path_shadow_y(scene, slot), path_shadow_z(scene, slot));
    return ray;
}

INLINE float shadow_reach(const Scene *scene, uint slot)
{
#if CLVOL_HAS_POINT || CLVOL_HAS_SPOT || CLVOL_HAS_AREA
    return path_shadow_distance(scene, slot);
#else
    return INFINITY;
#endif
}

#if CLVOL_HAS_SURFACES
/* The lamp's point that the ray runs to.  A line meets the front of a triangle, disk, sphere or cylinder once, so what it
   meets there is that point, however t was rounded; a sphere or cylinder that shines outwards hides behind its front.
   One that shines inwards may be met from behind first, and so may other triangles of a mesh: they hide the point, unless
   they are as far as it is, where rounding alone decides which side of an edge the ray passes on. */
INLINE Target shadow_target(const Scene *scene, uint slot, Ray ray, float reach)
{
    Target target = {NO_PRIMITIVE, NO_PRIMITIVE, 0, 0.0f};
#if CLVOL_HAS_AREA
    const uint primitive = path_shadow_primitive(scene, slot);
    if (primitive == NO_PRIMITIVE)
        return target;
    __global const Shape *shape = scene->shapes + primitive_shape(scene, primitive);
    __global const Emitter *lamp = scene->emitters + shape->emitter;
    const bool met_once = shape->kind == SURFACE_MESH || shape->kind == SURFACE_DISK || !shape->flip;
    target.primitive = met_once ? primitive : NO_PRIMITIVE;
    target.first = lamp->primitive;
    target.count = lamp->count;
    target.near_ = reach - (largest3(ray.o) + reach) * 0x1p-18f;
#endif
    return target;
}
#endif

#if CLVOL_HAS_PASSABLE
/* Surfaces that the shadow ray has passed, and the last of them. */
typedef struct {
    uint count;
    Hit last;
} Passed;

INLINE Passed shadow_passed(const Scene *scene, uint slot)
{
    Passed passed = {0, {0.0f, 0.0f, 0.0f, NO_PRIMITIVE}};
#if CLVOL_HAS_HETEROGENEOUS
    if (path_shadow_leg(scene, slot) > 0) {
        passed.count = path_shadow_stretch(scene, slot);
        passed.last.t = path_shadow_after_t(scene, slot);
        passed.last.primitive = path_shadow_after_primitive(scene, slot);
    }
#endif
    return passed;
}

INLINE void set_shadow_passed(const Scene *scene, uint slot, const Passed *passed)
{
#if CLVOL_HAS_HETEROGENEOUS
    set_path_shadow_stretch(scene, slot, passed->count);
    set_path_shadow_after_t(scene, slot, passed->last.t);
    set_path_shadow_after_primitive(scene, slot, passed->last.primitive);
#endif
}

/* What share of the light arrives: walks from surface to surface, up to the first that is opaque.  Where a walk stops
   short, the share up to there. */
INLINE Spectrum shadow_share(const Scene *scene, uint slot, Tally *tally)
{
    const Ray ray = shadow_ray(scene, slot);
    const float reach = shadow_reach(scene, slot);
    const int channel = (int)path_channel_or_zero(scene, slot);
    Spectrum share = (Spectrum)(1.0f);
#if CLVOL_HAS_MEDIA
    const SampleKey key = path_key(scene, slot);
    Extinction transmittance = (Extinction)(1.0f);
#endif
    Inside inside = get_shadow_inside(scene, slot);
    const Target target = shadow_target(scene, slot, ray, reach);
    for (Passed passed = shadow_passed(scene, slot); passed.count < MOST_PASSED; ++passed.count) {
        Hit hit = closest_hit(scene, ray, passed.last.t, passed.last.primitive, reach);
        const bool last = hit.primitive == NO_PRIMITIVE || is_target(&hit, &target);
        Spectrum through = (Spectrum)(1.0f);
        Surface surface;
        if (!last) {
            surface = hit_surface(scene, ray, &hit);
            const float3 wi = to_local(&surface, -ray.d);
            Side side;
            if (!side_of(scene, scene->shapes + surface.shape, wi, &side))
                return (Spectrum)(0.0f);
            through = null_transmission(scene, side.material, surface.uv, wi.z, channel);
            if (!(spectrum_max(share * through) > 0.0f))
                return share * through;
        }
#if CLVOL_HAS_MEDIA
        if (!media_transmittance(scene, slot, key, ray, &inside, passed.count, passed.last.t, last ? reach : hit.t,
                                 channel, tally, &transmittance)) {
            if (!tally->stopped)
                return (Spectrum)(0.0f);
            set_shadow_passed(scene, slot, &passed);
            set_shadow_inside(scene, slot, inside);
            return share * transmittance;
        }
        if (last)
            return share * transmittance;
#else
        if (last)
            return share;
#endif
        share *= through;
        cross_boundary(scene->shapes + surface.shape, surface.ng, ray.d, &inside);
        passed.last = hit;
    }
    set_path_exhausted(scene, slot, path_exhausted(scene, slot) + 1);
    return (Spectrum)(0.0f);
}
#else
/* What share of the light arrives, or, where a walk stops short, comes so far. */
INLINE Spectrum shadow_share(const Scene *scene, uint slot, Tally *tally)
{
    const Ray ray = shadow_ray(scene, slot);
    const float reach = shadow_reach(scene, slot);
#if CLVOL_HAS_SURFACES
    const Target target = shadow_target(scene, slot, ray, reach);
    if (any_hit(scene, ray, reach, &target))
        return (Spectrum)(0.0f);
#endif
    Spectrum share = (Spectrum)(1.0f);
#if CLVOL_HAS_MEDIA
    Inside inside = get_shadow_inside(scene, slot);
    Extinction transmittance = (Extinction)(1.0f);
    media_transmittance(scene, slot, path_key(scene, slot), ray, &inside, 0, 0.0f, reach,
                        (int)path_channel_or_zero(scene, slot), tally, &transmittance);
    share *= transmittance;
#endif
    return share;
}
#endif

/* Returns the steps that the walks took. */
INLINE uint shadow_transmittance(const Scene *scene, uint group, uint slot)
{
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    const Spectrum share = shadow_share(scene, slot, &tally);
#if CLVOL_HAS_MEDIA
    record_tally(scene, slot, tally);
#endif
    if (tally.stopped) {
        set_shadow(scene, slot, get_shadow(scene, slot) * share);
        queue_push(scene, group, QUEUE_SHADE, slot);
    } else {
        set_radiance(scene, slot, get_radiance(scene, slot) + get_shadow(scene, slot) * share);
        queue_push(scene, group, path_next(scene, slot), slot);
    }
    return steps_of(&tally);
}

#endif
#endif
