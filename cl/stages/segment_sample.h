/* Several media, or media and surfaces: walks all that lie on the segment of ray up to the next surface.

   Media that overlap compete as independent processes: a walk ends at the nearest collision found so far, and the
   nearest of all wins.  Weights are those of every walk up to that collision (METHODS §6): the walks that went
   beyond it before it was known are repeated, with the same random numbers, only as far.  In the mean, the walk
   that collides contributes sigma_t T of its medium and each of the others its T.  A walk that stops
   short of its end counts as if it had collided there; if that is the nearest, all go on from there. */
#ifndef CLVOL_STAGES_SEGMENT_SAMPLE_H
#define CLVOL_STAGES_SEGMENT_SAMPLE_H
#include "core/sampler.h"
#include "path/key.h"
#include "path/ray.h"
#include "path/tally.h"
#include "path/transitions.h"
#include "stages/media.h"
#include "stages/medium_collision.h"
#include "stages/joint_weights.h"
#if CLVOL_HAS_GLOW
#include "stages/glow.h"
#endif

/* Returns the steps that the walks took. */
INLINE uint medium_sample(const Scene *scene, uint group, uint slot)
{
    const SampleKey key = path_key(scene, slot);
    const Ray ray = path_ray(scene, slot);
    const Inside inside = path_inside(scene, slot);
    const Walked walked = take_walked(scene, slot, path_after_t(scene, slot));
    const float from = walked.t, to = segment_end(scene, slot, ray);
    const Spectrum before = path_beta(scene, slot);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    Collision collision;
    collision.emission = (Spectrum)(0.0f);
    Spectrum beta = before, winning = before;
    float limit = min_of(to, ray_limit(scene, slot, ray)); /* nothing that begins beyond counts */
    float reach = to;
    float3 end = ray.o;
    int winner = -1;
    bool stopped = false; /* the winner, rather than collided */
    Walked reached = walked;
    for (int pass = 0; pass < (JOINT_WEIGHTS ? 2 : 1); ++pass) {
        if (pass == 1) {
            if (winner < 0)
                break;
            beta = winning;
        }
        MediumSegment segment = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
        while (next_medium_segment(scene, ray, &inside, from, to, limit, &segment)) {
            if (pass == 1 && segment.medium == winner)
                continue;
            Ray start = ray;
            start.o = span_point(&segment.span, ray);
            const float length = min_of(segment.span.end - segment.span.start, reach - segment.start);
            const MediumRay in = segment_ray(scene, &inside, segment.medium, start, length,
                                             (int)path_channel(scene, slot));
            const uint number = walk_number(scene, path_segment(scene, slot), segment.medium);
            const uint4 k = leg_block(decision_block(scene, key, BLOCK_WALK, number), walked.leg);
            collision.beta = JOINT_WEIGHTS ? before : beta;
            const bool collided = medium_collision(&in, k, &tally, &collision);
            beta = JOINT_WEIGHTS ? beta * weight_ratio(collision.beta, before) : collision.beta;
            const bool stops = goes_on(walked, &tally);
            if ((collided || stops) && pass == 0) {
                winner = segment.medium;
                winning = collision.beta;
                stopped = stops;
                if (stopped)
                    reached = walk_on(walked, segment.start, tally.stop_t);
                limit = reach = stopped ? reached.t : segment.start + collision.t;
                end = CLVOL_HAS_THIN ? start.o + collision.t * ray.d : ray.o + reach * ray.d;
                if (!CLVOL_HAS_OVERLAP)
                    break;
            }
        }
    }
#if CLVOL_WEIGHTED
    MediumSegment first = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
    if (next_medium_segment(scene, ray, &inside, from, to, INFINITY, &first))
        subtract_background(scene, slot, scene->media + first.medium, (int)path_channel(scene, slot), beta);
#endif
#if CLVOL_HAS_GLOW
    gather_glow_of_segments(scene, slot, ray, &inside, walked, reach, limit, before, &tally);
#endif
    record_walk(scene, slot, tally, beta, collision.emission);
    uint event = path_event(scene, slot);
    if (stopped) {
        set_walked(scene, slot, reached);
        event = EVENT_WALK;
    } else if (winner >= 0) {
        set_path_medium(scene, slot, winner);
        set_path_origin(scene, slot, end);
        event = EVENT_COLLISION;
    }
    to_shade(scene, group, slot, event);
    return steps_of(&tally);
}

#endif
