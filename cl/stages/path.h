/* Path slots and queues: how stages hand paths to each other.

   A work-group owns CLVOL_GROUP_SLOTS slots and its own part of every queue, so that groups never
   wait for each other.  A queue holds slot numbers; its order is not defined and nothing depends on it. */
#ifndef CLVOL_STAGES_PATH_H
#define CLVOL_STAGES_PATH_H
#include "core/random.h"
#include "core/scene.h"
#include "tracking/tally.h"

INLINE __global uint *queue_counter(const Scene *scene, uint group, uint queue)
{
    return scene->counts + group * COUNTER_STRIDE + queue;
}

INLINE __global uint *queue_entries(const Scene *scene, uint group, uint queue)
{
    return scene->queues + (group * QUEUE_COUNT + queue) * CLVOL_GROUP_SLOTS;
}

/* Slots of the group that hold no path. */
INLINE __global uint *idle_counter(const Scene *scene, uint group)
{
    return scene->counts + group * COUNTER_STRIDE + QUEUE_COUNT;
}

INLINE void queue_push(const Scene *scene, uint group, uint queue, uint slot)
{
    const uint place = atomic_inc(queue_counter(scene, group, queue));
    queue_entries(scene, group, queue)[place] = slot;
}

/* Empties a queue once the whole group has read its length and entries; nobody pushes to the queue
   that its own stage reads. */
INLINE void queue_clear(const Scene *scene, uint group, uint queue)
{
    barrier(CLK_GLOBAL_MEM_FENCE);
    if (get_local_id(0) == 0)
        *queue_counter(scene, group, queue) = 0;
}

/* Steps of a work-item beyond which it leaves the other slots to the next wave, so that no launch takes long. */
#define STAGE_STEPS (1u << 13)

INLINE uint steps_of(const Tally *tally)
{
    return tally->tentative + tally->cells + tally->lookups;
}

/* Has the slot walk, or send its shadow ray, in the next wave. */
INLINE void stand_by(const Scene *scene, uint group, uint slot, uint event)
{
    set_path_event(scene, slot, event);
    queue_push(scene, group, QUEUE_SHADE, slot);
}

INLINE SampleKey path_key(const Scene *scene, uint slot)
{
    SampleKey key;
    key.pixel = path_pixel(scene, slot);
    key.sample = path_sample(scene, slot);
    key.bounce = path_bounce(scene, slot);
    return key;
}

INLINE Ray path_ray(const Scene *scene, uint slot)
{
    Ray ray;
    ray.o = (float3)(path_origin_x(scene, slot), path_origin_y(scene, slot), path_origin_z(scene, slot));
    ray.d = (float3)(path_direction_x(scene, slot), path_direction_y(scene, slot), path_direction_z(scene, slot));
    return ray;
}

INLINE void set_path_origin(const Scene *scene, uint slot, float3 o)
{
    set_path_origin_x(scene, slot, o.x);
    set_path_origin_y(scene, slot, o.y);
    set_path_origin_z(scene, slot, o.z);
}

INLINE void set_path_direction(const Scene *scene, uint slot, float3 d)
{
    set_path_direction_x(scene, slot, d.x);
    set_path_direction_y(scene, slot, d.y);
    set_path_direction_z(scene, slot, d.z);
}

INLINE uint path_channel_or_zero(const Scene *scene, uint slot)
{
#if CLVOL_ONE_CHANNEL_PER_PATH
    return path_channel(scene, slot);
#else
    return 0;
#endif
}

/* How far along its ray the path is: where it last passed a surface. */
INLINE float path_after(const Scene *scene, uint slot)
{
#if CLVOL_HAS_PASSABLE
    return path_after_t(scene, slot);
#else
    return 0.0f;
#endif
}

INLINE uint path_stretch_or_zero(const Scene *scene, uint slot)
{
#if CLVOL_HAS_PASSABLE
    return path_stretch(scene, slot);
#else
    return 0;
#endif
}

/* Where the path's ray ends at a surface. */
INLINE float path_reach(const Scene *scene, uint slot)
{
#if CLVOL_HAS_SURFACES
    return path_hit_t(scene, slot);
#else
    return INFINITY;
#endif
}

/* A camera ray meets nothing beyond the far plane, and enters nothing there. */
INLINE float ray_limit(const Scene *scene, uint slot, Ray ray)
{
    if (path_bounce(scene, slot) > 0)
        return INFINITY;
    return scene->render->camera_far / dot(ray.d, load_vector(scene->render->camera_forward));
}

/* Where the stretch of ray ends that walks go along: at a surface, or, since beyond the far plane no boundary
   is met that might end a medium, there. */
INLINE float stretch_end(const Scene *scene, uint slot, Ray ray)
{
    const float reach = path_reach(scene, slot);
    return CLVOL_BOUNDARY_WORDS > 0 ? min_of(reach, ray_limit(scene, slot, ray)) : reach;
}

/* A new ray has passed nothing yet. */
INLINE void reset_ray(const Scene *scene, uint slot)
{
#if CLVOL_HAS_PASSABLE
    set_path_stretch(scene, slot, 0);
    set_path_after_t(scene, slot, 0.0f);
    set_path_after_primitive(scene, slot, NO_PRIMITIVE);
#endif
}

/* A new path is inside of nothing until `intersect` finds otherwise. */
INLINE void reset_path(const Scene *scene, uint slot)
{
    reset_ray(scene, slot);
#if CLVOL_BOUNDARY_WORDS > 0
    Inside inside;
    for (int w = 0; w < CLVOL_BOUNDARY_WORDS; ++w)
        inside.word[w] = 0;
    set_inside(scene, slot, inside);
#endif
#if CLVOL_HAS_TRANSMISSION
    set_path_eta_squared(scene, slot, 1.0f);
#endif
}

#if CLVOL_HAS_MEDIA
INLINE void record_tally(const Scene *scene, uint slot, Tally tally)
{
    set_path_tentative(scene, slot, path_tentative(scene, slot) + tally.tentative);
    set_path_real(scene, slot, path_real(scene, slot) + tally.real);
#if CLVOL_HAS_HETEROGENEOUS
    set_path_lookups(scene, slot, path_lookups(scene, slot) + tally.lookups);
    set_path_cells(scene, slot, path_cells(scene, slot) + tally.cells);
    if (tally.violations > 0)
        set_path_violations(scene, slot, path_violations(scene, slot) + tally.violations);
    if (tally.exhausted > 0)
        set_path_exhausted(scene, slot, path_exhausted(scene, slot) + tally.exhausted);
#endif
}

INLINE void record_weight(const Scene *scene, uint slot, float weight)
{
    if (weight > path_largest_weight(scene, slot))
        set_path_largest_weight(scene, slot, weight);
}
#endif

#if CLVOL_SPECTRUM == 1
#define CLVOL_SPECTRUM_FIELD(name) \
    INLINE Spectrum get_##name(const Scene *scene, uint slot) { return path_##name##_0(scene, slot); } \
    INLINE void set_##name(const Scene *scene, uint slot, Spectrum s) { set_path_##name##_0(scene, slot, s); }
#else
#define CLVOL_SPECTRUM_FIELD(name) \
    INLINE Spectrum get_##name(const Scene *scene, uint slot) \
    { \
        return (Spectrum)(path_##name##_0(scene, slot), path_##name##_1(scene, slot), path_##name##_2(scene, slot)); \
    } \
    INLINE void set_##name(const Scene *scene, uint slot, Spectrum s) \
    { \
        set_path_##name##_0(scene, slot, s.x); \
        set_path_##name##_1(scene, slot, s.y); \
        set_path_##name##_2(scene, slot, s.z); \
    }
#endif
CLVOL_SPECTRUM_FIELD(beta)
CLVOL_SPECTRUM_FIELD(radiance)
#if CLVOL_NEE
CLVOL_SPECTRUM_FIELD(shadow)
#endif

#endif
