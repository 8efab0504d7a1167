/* Attenuates one next-event ray by everything on its way and adds what arrives. */
#ifndef CLVOL_STAGES_SHADOW_TRANSMITTANCE_H
#define CLVOL_STAGES_SHADOW_TRANSMITTANCE_H
#include "tracking/tally.h"

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

/* Multiplies the transmittance of all media between `from` and `to`; false once nothing is left. */
INLINE bool media_transmittance(const Scene *scene, SampleKey key, Ray ray, const Inside *inside, uint stretch, float from,
                                float to, int channel, Tally *tally, Extinction *transmittance)
{
    for (uint m = 0; m < (CLVOL_HAS_MANY_MEDIA ? scene->render->media : 1u); ++m) {
        Span span;
        if (!medium_part(scene, m, ray, inside, from, to, &span))
            continue;
        const uint4 k = decision_block(scene, key, BLOCK_SHADOW, walk_number(scene, stretch, (int)m));
        Ray start = ray;
        start.o = span_point(&span, ray);
        const MediumRay in = part_ray(scene, inside, (int)m, start, span.end - span.start, channel);
        *transmittance *= medium_transmittance(&in, k, tally);
        if (extinction_max(*transmittance) == 0.0f)
            return false;
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

/* What share of the light arrives: walks from surface to surface, up to the first that is opaque. */
INLINE Spectrum shadow_share(const Scene *scene, uint slot, Tally *tally)
{
    const Ray ray = shadow_ray(scene, slot);
    const float reach = shadow_reach(scene, slot);
    const int channel = (int)path_channel_or_zero(scene, slot);
    Spectrum share = (Spectrum)(1.0f);
    Extinction transmittance = (Extinction)(1.0f);
#if CLVOL_HAS_MEDIA
    const SampleKey key = path_key(scene, slot);
    Inside inside = get_shadow_inside(scene, slot);
#else
    Inside inside;
#endif
#if CLVOL_HAS_PASSABLE
    const Target target = shadow_target(scene, slot, ray, reach);
    Hit hit = {0.0f, 0.0f, 0.0f, NO_PRIMITIVE};
    for (uint stretch = 0; stretch < MOST_PASSED; ++stretch) {
        const float from = hit.t;
        hit = closest_hit(scene, ray, hit.t, hit.primitive, reach);
        const bool last = hit.primitive == NO_PRIMITIVE || is_target(&hit, &target);
        Surface surface;
        if (!last) {
            surface = hit_surface(scene, ray, &hit);
            const float3 wi = to_local(&surface, -ray.d);
            Side side;
            if (!side_of(scene, scene->shapes + surface.shape, wi, &side))
                return (Spectrum)(0.0f);
            share *= null_transmission(scene, side.material, surface.uv, wi.z, channel);
            if (!(spectrum_max(share) > 0.0f))
                return share;
        }
#if CLVOL_HAS_MEDIA
        if (!media_transmittance(scene, key, ray, &inside, stretch, from, last ? reach : hit.t, channel, tally,
                                 &transmittance))
            return (Spectrum)(0.0f);
#endif
        if (last)
            return share * transmittance;
        cross_boundary(scene->shapes + surface.shape, surface.ng, ray.d, &inside);
    }
    set_path_exhausted(scene, slot, path_exhausted(scene, slot) + 1);
    return (Spectrum)(0.0f);
#else
#if CLVOL_HAS_SURFACES
    const Target target = shadow_target(scene, slot, ray, reach);
    if (any_hit(scene, ray, reach, &target))
        return (Spectrum)(0.0f);
#endif
#if CLVOL_HAS_MEDIA
    media_transmittance(scene, key, ray, &inside, 0, 0.0f, reach, channel, tally, &transmittance);
#endif
    return share * transmittance;
#endif
}

INLINE void shadow_transmittance(const Scene *scene, uint group, uint slot)
{
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    const Spectrum share = shadow_share(scene, slot, &tally);
#if CLVOL_HAS_MEDIA
    record_tally(scene, slot, tally);
#endif
    set_radiance(scene, slot, get_radiance(scene, slot) + get_shadow(scene, slot) * share);
}

#endif
