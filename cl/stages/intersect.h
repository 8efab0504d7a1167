/* Finds the next stretch of medium along the path's ray.

   Every medium is convex and meets a ray in one interval; intervals are taken in the order of their
   entry, ties by number.  Overlapping media compete as independent processes: the walk in the next
   one ends at the nearest collision found so far, and the nearest of all wins (valid for trackers
   whose collisions carry no weight). */
#ifndef CLVOL_STAGES_INTERSECT_H
#define CLVOL_STAGES_INTERSECT_H

#if CLVOL_HAS_MEDIA
INLINE bool next_interval(const Scene *scene, Ray ray, int after_medium, float after_entry, float limit,
                                 int *found, float *start, float *end)
{
    *found = -1;
    float nearest = limit;
    for (int m = 0; m < (int)scene->render->media; ++m) {
        float t0 = 0.0f, t1 = INFINITY;
        medium_interval(scene->media + m, ray, &t0, &t1);
        const bool is_later = t0 > after_entry || (t0 == after_entry && m > after_medium);
        if (t0 < t1 && is_later && t0 < nearest) {
            nearest = t0;
            *found = m;
            *start = t0;
            *end = t1;
        }
    }
    return *found >= 0;
}
#endif

INLINE void intersect(const Scene *scene, uint group, uint slot)
{
#if CLVOL_HAS_MEDIA
    const Ray ray = path_ray(scene, slot);
    float limit = INFINITY;
    if (path_bounce(scene, slot) == 0) /* a camera ray enters nothing beyond the far plane */
        limit = scene->render->camera_far / dot(ray.d, load_vector(scene->render->camera_forward));
    int medium;
    float start, end;
#if CLVOL_HAS_MANY_MEDIA
    const bool first = path_interval(scene, slot) == 0;
    const int after_medium = first ? -1 : path_medium(scene, slot);
    const float after_entry = first ? 0.0f : path_entry(scene, slot);
#if CLVOL_HAS_OVERLAP
    if (path_hit_medium(scene, slot) >= 0)
        limit = min_of(limit, path_hit_distance(scene, slot));
#endif
#else
    const int after_medium = -1;
    const float after_entry = 0.0f;
#endif
    if (next_interval(scene, ray, after_medium, after_entry, limit, &medium, &start, &end)) {
#if CLVOL_HAS_MANY_MEDIA
        set_path_medium(scene, slot, medium);
        set_path_entry(scene, slot, start);
        set_path_interval(scene, slot, path_interval(scene, slot) + 1);
        set_path_interval_start(scene, slot, start);
#if CLVOL_HAS_OVERLAP
        end = path_hit_medium(scene, slot) >= 0 ? min_of(end, path_hit_distance(scene, slot)) : end;
#endif
        set_path_interval_end(scene, slot, end);
#else
        set_path_origin(scene, slot, ray.o + start * ray.d);
        set_path_interval_end(scene, slot, end - start);
#endif
        queue_push(scene, group, QUEUE_MEDIUM, slot);
        return;
    }
#if CLVOL_HAS_OVERLAP
    if (path_hit_medium(scene, slot) >= 0) {
        set_path_medium(scene, slot, path_hit_medium(scene, slot));
        set_path_origin(scene, slot, ray.o + path_hit_distance(scene, slot) * ray.d);
        set_path_event(scene, slot, EVENT_COLLISION);
        queue_push(scene, group, QUEUE_SHADE, slot);
        return;
    }
#endif
#endif
    set_path_event(scene, slot, EVENT_ESCAPE);
    queue_push(scene, group, QUEUE_SHADE, slot);
}

#endif
