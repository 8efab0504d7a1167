/* Walks the media ahead to a collision, or to the surface or infinity behind them. */
#ifndef CLVOL_STAGES_MEDIUM_SAMPLE_H
#define CLVOL_STAGES_MEDIUM_SAMPLE_H
#if CLVOL_HAS_MEDIA
#if CLVOL_LANES
#include "stages/sample_lanes.h"
#elif CLVOL_HAS_SEGMENTS
#include "stages/segment_sample.h"
#else
#include "core/sampler.h"
#include "path/key.h"
#include "path/ray.h"
#include "path/tally.h"
#include "path/transitions.h"
#include "stages/background.h"
#include "stages/medium_collision.h"
#if CLVOL_HAS_GLOW
#include "stages/glow.h"
#endif

/* The one medium of the scene, from the ray's start.  Returns the steps that it took. */
INLINE uint medium_sample(const Scene *scene, uint group, uint slot)
{
    const SampleKey key = path_key(scene, slot);
    const Ray ray = path_ray(scene, slot);
    const Walked walked = take_walked(scene, slot, 0.0f);
    MediumRay in = rest_of_ray(
        medium_ray(scene, scene->media, ray, path_medium_end(scene, slot), (int)path_channel(scene, slot)), walked.t);
#if CLVOL_EXPECTS_BACKGROUND
    in.rate = expecting_rate(scene, slot, in.rate);
#endif
    const uint4 k = leg_block(decision_block(scene, key, BLOCK_WALK, 0), walked.leg);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    Collision collision;
    collision.beta = path_beta(scene, slot);
    collision.emission = (Spectrum)(0.0f);
    bool collided = medium_collision(&in, k, &tally, &collision);
    const bool stopped = goes_on(walked, &tally);
#if CLVOL_EXPECTS_BACKGROUND
    collided = expect_light(scene, slot, in.world_ray.o, collision.expected, collided, stopped, following_number(k));
    tally.real = collided;
#elif CLVOL_WEIGHTED
    subtract_background(scene, slot, in.medium, in.channel, collision.beta);
#endif
#if CLVOL_HAS_GLOW
    gather_glow(scene, slot, &in, k, walked.leg, collided ? collision.t : (stopped ? tally.stop_t : in.t_max), &tally);
#endif
    record_walk(scene, slot, tally, collision.beta, collision.emission);
    uint event = path_event(scene, slot);
    if (stopped && !(CLVOL_EXPECTS_BACKGROUND && collided)) {
        set_walked(scene, slot, walk_on(walked, walked.t, tally.stop_t));
        event = EVENT_WALK;
    } else if (collided) {
        set_path_origin(scene, slot, ray.o + (walked.t + collision.t) * ray.d);
        event = EVENT_COLLISION;
    }
    to_shade(scene, group, slot, event);
    return steps_of(&tally);
}
#endif

#endif
#endif
