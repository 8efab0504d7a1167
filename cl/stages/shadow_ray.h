/* A path's shadow ray: where it runs to, how far its walk has come, and what becomes of its light. */
#ifndef CLVOL_STAGES_SHADOW_RAY_H
#define CLVOL_STAGES_SHADOW_RAY_H
#if CLVOL_NEE
#include "core/scene.h"
#include "geometry/bvh.h"
#if CLVOL_HAS_AREA
#include "geometry/surface.h"
#endif
#include "path/transitions.h"
#include "stages/legs.h"

#if CLVOL_HAS_MEDIA
/* Where the shadow ray's walk begins, at `from`, or goes on. */
INLINE Walked shadow_walked_so_far(const Scene *scene, uint slot, float from)
{
    Walked walked = {path_shadow_leg(scene, slot), from, 0.0f};
    if (walked.leg > 0) {
        walked.t = path_shadow_walked(scene, slot);
        walked.rest = path_shadow_walked_rest(scene, slot);
    }
    return walked;
}

/* The same, said once. */
INLINE Walked take_shadow_walked(const Scene *scene, uint slot, float from)
{
    const Walked walked = shadow_walked_so_far(scene, slot, from);
    if (walked.leg > 0)
        set_path_shadow_leg(scene, slot, 0);
    return walked;
}

INLINE void set_shadow_walked(const Scene *scene, uint slot, Walked walked)
{
    set_path_shadow_leg(scene, slot, walked.leg);
    set_path_shadow_walked(scene, slot, walked.t);
    set_path_shadow_walked_rest(scene, slot, walked.rest);
}
#endif

INLINE Ray shadow_ray(const Scene *scene, uint slot)
{
    Ray ray;
    ray.o = CLVOL_HAS_SURFACES ? path_shadow_origin(scene, slot) : path_origin(scene, slot);
    ray.d = path_shadow_direction(scene, slot);
    return ray;
}

#if CLVOL_HAS_SURFACES
/* The lamp's point that the ray runs to.  A line meets the front of a triangle, disk, sphere or cylinder once, so what
   it meets there is that point, however t was rounded; a sphere or cylinder that shines outwards hides behind its
   front.  One that shines inwards may be met from behind first, and so may other triangles of a mesh: they hide the
   point, unless they are as far as it is, where rounding alone decides which side of an edge the ray passes on. */
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

/* Adds what arrives of the shadow ray's light, and lets the path go on or end. */
INLINE void shadow_arrives(const Scene *scene, uint group, uint slot, Spectrum share)
{
    set_path_radiance(scene, slot, path_radiance(scene, slot) + path_shadow_light(scene, slot) * share);
    if (path_goes_on(scene, slot))
        to_intersect(scene, group, slot);
    else
        to_generate(scene, group, slot);
}

/* Keeps what has come so far; the walk goes on in the next wave. */
INLINE void shadow_waits(const Scene *scene, uint group, uint slot, Spectrum share)
{
    set_path_shadow_light(scene, slot, path_shadow_light(scene, slot) * share);
    to_shade(scene, group, slot, EVENT_SHADOW);
}

#endif
#endif
