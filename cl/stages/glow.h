/* Light that media emit whatever their extinction, q per length, gathered along the walk (METHODS §2).

   A walk that is still under way at t has the weight w(t) there, and E[w(t)] = T(t), whatever the technique: that is
   what brings the light from behind to the path's start.  So the integral of w q over the way that was flown, up to the
   collision that ends it or to the end of the segment, has the mean that is wanted, the integral of T q over all of
   the segment.  It is estimated at one point of each of some equal parts of the way, drawn evenly.

   No collision is needed: in vacuum the way is the whole segment, in dense media about a free path, so that the relative
   variance is bounded at any depth.  Of media that overlap, each is gathered over what it has of the way to the first
   collision of all: that the others were still flying at t gives their factors of T.

   What weighted walks weighed at a point is found by walking there once more, with the same random numbers. */
#ifndef CLVOL_STAGES_GLOW_H
#define CLVOL_STAGES_GLOW_H
#if CLVOL_HAS_GLOW
#include "core/sampler.h"
#include "medium/glow.h"
#include "path/key.h"
#include "stages/legs.h"
#if !CLVOL_LANES
#include "stages/medium_collision.h"
#endif
#if CLVOL_HAS_SEGMENTS
#include "stages/joint_weights.h"
#include "stages/media.h"
#endif

/* A multiple of 4.  Weighted walks through media that overlap are all repeated for each point, and their weights make
   most of the noise. */
#if CLVOL_WEIGHTED && CLVOL_HAS_OVERLAP
#define GLOW_POINTS 4
#else
/* On flames of 48^3 samples, with `joint` samples, 16 were 6 to 17 times as efficient as 4 where hardly
   anything scatters, and 1.1 to 1.8 times in a cloud of albedo 0.95; 32 were less than 16 there. */
#define GLOW_POINTS 16
#endif

/* A way through medium m, and where on it its glow is looked up. */
typedef struct {
    int medium;
    Ray ray;      /* from the start of the way */
    float length; /* of the way */
    int channel;
    uint4 numbers; /* each for every fourth part */
} GlowWay;

/* `number`: of the walk. */
INLINE GlowWay glow_way(const Scene *scene, SampleKey key, uint number, uint leg, int m, Ray ray, float length,
                        int channel)
{
    GlowWay way;
    way.medium = m;
    way.ray = ray;
    way.length = min_of(length, 1e30f);
    way.channel = channel;
    way.numbers = leg_block(decision_block(scene, key, BLOCK_GLOW, number), leg);
    return way;
}

/* How far along the way point n lies. */
INLINE float glow_t(const GlowWay *way, int n)
{
    const uint4 k = way->numbers;
    const uint number = (n & 2) ? ((n & 1) ? k.w : k.z) : ((n & 1) ? k.y : k.x);
    return ((float)n + uniform_below_one(number)) * (way->length * (1.0f / GLOW_POINTS));
}

/* What point n adds, to which the path got with such a weight. */
INLINE Spectrum glow_of(const Scene *scene, const GlowWay *way, int n, Spectrum weight)
{
    const float3 p = way->ray.o + glow_t(way, n) * way->ray.d;
    return weight * (way->length * (1.0f / GLOW_POINTS)) * glow_at(scene, way->medium, p, way->channel);
}

INLINE void add_glow(const Scene *scene, uint slot, Spectrum glow)
{
    if (!CLVOL_HAS_MAX_DEPTH || scene->render->max_depth > 0)
        set_path_radiance(scene, slot, path_radiance(scene, slot) + glow);
}

#if CLVOL_LANES
/* Of the one medium of the scene, through which a walk flew so far. */
INLINE void gather_glow(const Scene *scene, const LanePath *path, uint leg, float flown)
{
    const uint slot = path->slot;
    const Ray ray = {path->start, path_direction(scene, slot)};
    uint number = 0;
    float presence = 1.0f;
#if CLVOL_HAS_SEGMENTS
    number = walk_number(scene, path_segment(scene, slot), 0);
#if CLVOL_BOUNDARY_WORDS > 0
    const Inside inside = path_inside(scene, slot);
    presence = (float)medium_presence(scene, 0, &inside);
#endif
#endif
    const GlowWay way = glow_way(scene, path_key(scene, slot), number, leg, 0, ray, flown,
                                 (int)path_channel(scene, slot));
    const Spectrum weight = presence * path_beta(scene, slot);
    Spectrum glow = (Spectrum)(0.0f);
    for (int n = 0; n < GLOW_POINTS; ++n)
        glow += glow_of(scene, &way, n, weight);
    add_glow(scene, slot, glow);
}
#else
/* The weight at the end of `in` of a walk that began with `before`, got at least as far, and had the numbers k. */
INLINE Spectrum weight_at_end(const MediumRay *in, uint4 k, Spectrum before, Tally *tally)
{
#if CLVOL_WEIGHTED
    Tally own = {0, 0, 0, 0, 0, 0, 0.0f};
    Collision collision;
    collision.beta = before;
    collision.emission = (Spectrum)(0.0f);
    if (medium_collision(in, k, &own, &collision))
        return (Spectrum)(0.0f); /* just before the end, where the walk collided just behind: that is rounding */
    tally->lookups += own.lookups;
    tally->cells += own.cells;
    return collision.beta;
#else
    return before;
#endif
}

#if CLVOL_HAS_SEGMENTS
/* What all walks from walked.t on weigh at t, all of which got at least as far. */
INLINE Spectrum weight_of_all(const Scene *scene, uint slot, Ray ray, const Inside *inside, Walked walked, float t,
                              float limit, Spectrum before, Tally *tally)
{
    Spectrum beta = before;
#if CLVOL_WEIGHTED
    const SampleKey key = path_key(scene, slot);
    MediumSegment segment = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
    while (next_medium_segment(scene, ray, inside, walked.t, t, min_of(t, limit), &segment)) {
        Ray start = ray;
        start.o = span_point(&segment.span, ray);
        const MediumRay in = segment_ray(scene, inside, segment.medium, start, segment.span.end - segment.span.start,
                                         (int)path_channel(scene, slot));
        const uint number = walk_number(scene, path_segment(scene, slot), segment.medium);
        const uint4 k = leg_block(decision_block(scene, key, BLOCK_WALK, number), walked.leg);
        const Spectrum after = weight_at_end(&in, k, JOINT_WEIGHTS ? before : beta, tally);
        beta = JOINT_WEIGHTS ? beta * weight_ratio(after, before) : after;
    }
#endif
    return beta;
}

/* Of every medium that begins between walked.t and `limit`, up to `reach`, where the first of the walks ended. */
INLINE void gather_glow_of_segments(const Scene *scene, uint slot, Ray ray, const Inside *inside, Walked walked,
                                    float reach, float limit, Spectrum before, Tally *tally)
{
    const SampleKey key = path_key(scene, slot);
    Spectrum glow = (Spectrum)(0.0f);
    MediumSegment segment = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
    while (next_medium_segment(scene, ray, inside, walked.t, reach, limit, &segment)) {
        if (!glows(scene, segment.medium))
            continue;
        Ray start = ray;
        start.o = span_point(&segment.span, ray);
        const uint number = walk_number(scene, path_segment(scene, slot), segment.medium);
        const GlowWay way = glow_way(scene, key, number, walked.leg, segment.medium, start,
                                     segment.span.end - segment.span.start, (int)path_channel(scene, slot));
        float presence = 1.0f;
#if CLVOL_BOUNDARY_WORDS > 0
        presence = (float)medium_presence(scene, (uint)segment.medium, inside);
#endif
        for (int n = 0; n < GLOW_POINTS; ++n) {
            const Spectrum weight = weight_of_all(scene, slot, ray, inside, walked, segment.start + glow_t(&way, n),
                                                  limit, before, tally);
            glow += glow_of(scene, &way, n, presence * weight);
        }
    }
    add_glow(scene, slot, glow);
}
#else
/* Of the one medium of the scene, through which a walk flew so far. */
INLINE void gather_glow(const Scene *scene, uint slot, const MediumRay *in, uint4 k, uint leg, float flown,
                        Tally *tally)
{
    const Spectrum before = path_beta(scene, slot);
    const GlowWay way = glow_way(scene, path_key(scene, slot), 0, leg, 0, in->world_ray, flown, in->channel);
    Spectrum glow = (Spectrum)(0.0f);
    for (int n = 0; n < GLOW_POINTS; ++n) {
        MediumRay part = *in;
        part.t_max = glow_t(&way, n);
        glow += glow_of(scene, &way, n, weight_at_end(&part, k, before, tally));
    }
    add_glow(scene, slot, glow);
}
#endif
#endif

#endif
#endif
