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
#include "stages/straight.h"
#endif
#include "path/key.h"
#include "path/tally.h"
#include "path/transitions.h"
#include "stages/media.h"
#include "stages/shadow_ray.h"
#if CLVOL_HAS_HETEROGENEOUS
#include CLVOL_TRANSMITTANCE_HEADER
#endif
#include "tracking/homogeneous_transmittance.h"

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
INLINE bool media_transmittance(const Scene *scene, uint slot, SampleKey key, Ray ray, const Inside *inside,
                                uint segment, float from, float to, int channel, Tally *tally,
                                Extinction *transmittance)
{
    Walked walked = take_shadow_walked(scene, slot, from);
    uint m = walked.leg > 0 ? path_shadow_medium(scene, slot) : 0;
    for (; m < (CLVOL_HAS_MANY_MEDIA ? scene->render->media : 1u); ++m, walked.leg = 0, walked.t = from) {
        Span span;
        if (!medium_segment(scene, m, ray, inside, walked.t, to, &span))
            continue;
        const uint4 block = decision_block(scene, key, BLOCK_SHADOW, walk_number(scene, segment, (int)m));
        Ray start = ray;
        start.o = span_point(&span, ray);
        const MediumRay in = segment_ray(scene, inside, (int)m, start, span.end - span.start, channel);
        *transmittance *= medium_transmittance(&in, leg_block(block, walked.leg), tally);
        if (extinction_max(*transmittance) == 0.0f) {
            tally->stopped = 0;
            return false;
        }
        if (goes_on(walked, tally)) {
            set_shadow_walked(scene, slot, walk_on(walked, span_t(&span), tally->stop_t));
            set_path_shadow_medium(scene, slot, m);
            return false;
        }
    }
    return true;
}
#endif

#if CLVOL_LANES
#include "stages/shadow_lanes.h"
#else
#if CLVOL_HAS_PASSABLE
/* Surfaces that the shadow ray has passed, and the last of them. */
typedef struct {
    uint count;
    Hit last;
} Passed;

INLINE Passed shadow_passed(const Scene *scene, uint slot)
{
    Passed passed = {0, {0.0f, 0.0f, 0.0f, NO_PRIMITIVE}};
    if (path_shadow_leg(scene, slot) > 0) {
        passed.count = path_shadow_segment(scene, slot);
        passed.last.t = path_shadow_after_t(scene, slot);
        passed.last.primitive = path_shadow_after_primitive(scene, slot);
    }
    return passed;
}

INLINE void set_shadow_passed(const Scene *scene, uint slot, const Passed *passed)
{
    set_path_shadow_segment(scene, slot, passed->count);
    set_path_shadow_after_t(scene, slot, passed->last.t);
    set_path_shadow_after_primitive(scene, slot, passed->last.primitive);
}

/* What share of the light arrives: walks from surface to surface, up to the first that is opaque.  Where a walk stops
   short, the share up to there. */
INLINE Spectrum shadow_share(const Scene *scene, uint slot, Tally *tally)
{
    const Ray ray = shadow_ray(scene, slot);
    const float reach = path_shadow_distance(scene, slot);
    const int channel = (int)path_channel(scene, slot);
    Spectrum share = (Spectrum)(1.0f);
#if CLVOL_HAS_MEDIA
    const SampleKey key = path_key(scene, slot);
    Extinction transmittance = (Extinction)(1.0f);
#endif
    Inside inside = path_shadow_inside(scene, slot);
    const Target target = shadow_target(scene, slot, ray, reach);
#if CLVOL_HAS_VOLUME_TEXTURES
    Scene there = *scene;
    scene = &there;
#endif
    for (Passed passed = shadow_passed(scene, slot); passed.count < MOST_PASSED; ++passed.count) {
        Hit hit = closest_hit(scene, ray, passed.last.t, passed.last.primitive, reach);
        const bool last = hit.primitive == NO_PRIMITIVE || is_target(&hit, &target);
        Spectrum through = (Spectrum)(1.0f);
        Surface surface;
        if (!last) {
            surface = hit_surface(scene, ray, &hit);
#if CLVOL_HAS_VOLUME_TEXTURES
            there.texture_point = surface.p;
#endif
            const float3 wi = to_local(&surface, -ray.d);
            Side side;
            if (!side_of(scene, scene->shapes + surface.shape, wi, &side))
                return (Spectrum)(0.0f);
            through = STRAIGHT_TRANSMISSION;
            if (!(spectrum_max(share * through) > 0.0f))
                return share * through;
        }
#if CLVOL_HAS_MEDIA
        if (!media_transmittance(scene, slot, key, ray, &inside, passed.count, passed.last.t, last ? reach : hit.t,
                                 channel, tally, &transmittance)) {
            if (!tally->stopped)
                return (Spectrum)(0.0f);
            set_shadow_passed(scene, slot, &passed);
            set_path_shadow_inside(scene, slot, inside);
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
    const float reach = path_shadow_distance(scene, slot);
#if CLVOL_HAS_SURFACES
    const Target target = shadow_target(scene, slot, ray, reach);
    if (any_hit(scene, ray, reach, &target))
        return (Spectrum)(0.0f);
#endif
    Spectrum share = (Spectrum)(1.0f);
#if CLVOL_HAS_MEDIA
    Inside inside = path_shadow_inside(scene, slot);
    Extinction transmittance = (Extinction)(1.0f);
    media_transmittance(scene, slot, path_key(scene, slot), ray, &inside, 0, 0.0f, reach,
                        (int)path_channel(scene, slot), tally, &transmittance);
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
    if (tally.stopped)
        shadow_waits(scene, group, slot, share);
    else
        shadow_arrives(scene, group, slot, share);
    return steps_of(&tally);
}
#endif

#endif
#endif
