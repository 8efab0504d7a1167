/* Finds what lies ahead on the path's ray: the first surface, and whether media come before it. */
#ifndef CLVOL_STAGES_INTERSECT_H
#define CLVOL_STAGES_INTERSECT_H
#include "geometry/bvh.h"
#include "geometry/interval.h"
#if CLVOL_CAMERA_INSIDE
#include "stages/boundary.h"
#endif
#include "stages/hit.h"
#if CLVOL_HAS_STRETCHES
#include "stages/media.h"
#endif
#include "stages/path.h"

#if CLVOL_HAS_SURFACES
/* Finds the first surface beyond those already passed. */
INLINE void intersect_surfaces(const Scene *scene, uint slot, Ray ray)
{
    const Hit hit = closest_hit(scene, ray, path_after(scene, slot), path_after_primitive_or_none(scene, slot),
                                ray_limit(scene, slot, ray));
    set_path_hit(scene, slot, &hit);
    set_path_event(scene, slot, hit.primitive == NO_PRIMITIVE ? EVENT_ESCAPE : EVENT_SURFACE);
#if CLVOL_CAMERA_INSIDE
    if (path_bounce(scene, slot) == 0 && path_stretch_or_zero(scene, slot) == 0)
        set_inside(scene, slot, find_inside(scene, ray));
#endif
}
#endif

INLINE void intersect(const Scene *scene, uint group, uint slot)
{
    const Ray ray = path_ray(scene, slot);
#if CLVOL_HAS_SURFACES
    intersect_surfaces(scene, slot, ray);
#else
    set_path_event(scene, slot, EVENT_ESCAPE);
#endif
#if CLVOL_HAS_STRETCHES
    const Inside inside = get_inside(scene, slot);
    Part part = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
    if (next_part(scene, ray, &inside, path_after(scene, slot), stretch_end(scene, slot, ray),
                  ray_limit(scene, slot, ray), &part)) {
        queue_push(scene, group, QUEUE_MEDIUM, slot);
        return;
    }
#elif CLVOL_HAS_MEDIA
    Span span;
    if (medium_span(scene->media, ray, 0.0f, INFINITY, &span) && span_t(&span) < ray_limit(scene, slot, ray)) {
        set_path_origin(scene, slot, span_point(&span, ray));
        set_path_interval_end(scene, slot, span.end - span.start);
        queue_push(scene, group, QUEUE_MEDIUM, slot);
        return;
    }
#endif
    queue_push(scene, group, QUEUE_SHADE, slot);
}

#endif
