/* Finds what lies ahead on the path's ray: the first surface, and whether media come before it. */
#ifndef CLVOL_STAGES_INTERSECT_H
#define CLVOL_STAGES_INTERSECT_H
#include "geometry/bvh.h"
#include "geometry/span.h"
#if CLVOL_CAMERA_INSIDE
#include "stages/boundary.h"
#endif
#if CLVOL_HAS_SEGMENTS
#include "stages/media.h"
#endif
#if CLVOL_LAMP_EDGES
#include "stages/lamp_edges.h"
#endif
#include "path/ray.h"
#include "path/transitions.h"

#if CLVOL_HAS_SURFACES
INLINE void set_path_hit(const Scene *scene, uint slot, const Hit *hit)
{
    set_path_hit_t(scene, slot, hit->primitive == NO_PRIMITIVE ? INFINITY : hit->t);
    set_path_hit_primitive(scene, slot, hit->primitive);
    set_path_hit_u(scene, slot, hit->u);
    set_path_hit_v(scene, slot, hit->v);
}

/* Finds the first surface beyond those already passed; whether there is one. */
INLINE bool intersect_surfaces(const Scene *scene, uint slot, Ray ray)
{
    const Hit hit = closest_hit(scene, ray, path_after_t(scene, slot), path_after_primitive(scene, slot),
                                ray_limit(scene, slot, ray));
    set_path_hit(scene, slot, &hit);
#if CLVOL_CAMERA_INSIDE
    if (path_bounce(scene, slot) == 0 && path_segment(scene, slot) == 0)
        set_path_inside(scene, slot, find_inside(scene, ray));
#endif
    return hit.primitive != NO_PRIMITIVE;
}
#endif

INLINE void intersect(const Scene *scene, uint group, uint slot)
{
    const Ray ray = path_ray(scene, slot);
#if CLVOL_LAMP_EDGES
    refine_lamp_edge(scene, slot, ray);
#endif
    uint event = EVENT_ESCAPE;
#if CLVOL_HAS_SURFACES
    if (intersect_surfaces(scene, slot, ray))
        event = EVENT_SURFACE;
#endif
#if CLVOL_HAS_SEGMENTS
    const Inside inside = path_inside(scene, slot);
    MediumSegment segment = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
    if (next_medium_segment(scene, ray, &inside, path_after_t(scene, slot), segment_end(scene, slot, ray),
                            ray_limit(scene, slot, ray), &segment)) {
        to_medium(scene, group, slot, event);
        return;
    }
#elif CLVOL_HAS_MEDIA
    Span span;
    if (medium_span(scene->media, ray, 0.0f, INFINITY, &span) && span_t(&span) < ray_limit(scene, slot, ray)) {
        set_path_origin(scene, slot, span_point(&span, ray));
        set_path_medium_end(scene, slot, span.end - span.start);
        to_medium(scene, group, slot, event);
        return;
    }
#endif
    to_shade(scene, group, slot, event);
}

#endif
