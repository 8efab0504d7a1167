/* Walks through the one medium of a scene to a collision, or to the surface or infinity behind it, in lanes
   (kernels/lanes.cl). */
#ifndef CLVOL_STAGES_SAMPLE_LANES_H
#define CLVOL_STAGES_SAMPLE_LANES_H
#if CLVOL_LANES
#include "path/key.h"
#include "path/ray.h"
#include "path/tally.h"
#include "path/transitions.h"
#include "stages/background.h"
#include "stages/media.h"
#include "stages/medium_collision.h"
#include "tracking/lanes.h"
#if CLVOL_HAS_GLOW
#include "stages/glow.h"
#endif

#define LANE_BLOCK BLOCK_WALK

INLINE SampleKey lane_key(const Scene *scene, uint slot, uint *segment)
{
    *segment = walk_number(scene, path_segment(scene, slot), 0);
    return path_key(scene, slot);
}

INLINE bool lane_begin(const Scene *scene, uint group, uint slot, LaneWalk *walk)
{
    Ray ray = path_ray(scene, slot);
    const int channel = (int)path_channel(scene, slot);
    const Walked walked = walked_so_far(scene, slot, path_after_t(scene, slot));
#if CLVOL_HAS_SEGMENTS
    const Inside inside = path_inside(scene, slot);
    const float to = segment_end(scene, slot, ray);
    MediumSegment segment = {-1, 0.0f, {0.0f, 0.0f, 0.0f}};
    if (!next_medium_segment(scene, ray, &inside, walked.t, to, min_of(to, ray_limit(scene, slot, ray)), &segment)) {
        to_shade(scene, group, slot, path_event(scene, slot));
        return false;
    }
    ray.o = span_point(&segment.span, ray);
    walk->from = segment.start;
    walk->in = segment_ray(scene, &inside, 0, ray, segment.span.end - segment.span.start, channel);
#else
    walk->from = walked.t;
    walk->in = rest_of_ray(medium_ray(scene, scene->media, ray, path_medium_end(scene, slot), channel), walked.t);
#endif
#if CLVOL_EXPECTS_BACKGROUND
    walk->in.rate = expecting_rate(scene, slot, walk->in.rate);
#endif
    lane_leg(walk, walked.leg);
    return true;
}

INLINE void lane_end(const Scene *scene, uint group, const LanePath *path, const LaneArrival *arrival)
{
    const uint slot = path->slot;
    Tally tally = arrival->tally;
    const Walked walked = take_walked(scene, slot, path->from);
    const bool stopped = goes_on(walked, &tally);
#if CLVOL_HAS_GLOW
    gather_glow(scene, path, walked.leg, arrival->happened || stopped ? arrival->t : path->length);
#endif
    bool collided = arrival->happened;
#if CLVOL_EXPECTS_BACKGROUND
    collided = expect_light(scene, slot, path->start, arrival->expected, collided, stopped, following_number(path->k));
    tally.real = collided;
#endif
    record_tally(scene, slot, tally);
    uint event = path_event(scene, slot);
    if (stopped && !(CLVOL_EXPECTS_BACKGROUND && collided)) {
        set_walked(scene, slot, walk_on(walked, path->from, tally.stop_t));
        event = EVENT_WALK;
    } else if (collided) {
        set_path_medium(scene, slot, 0);
        set_path_origin(scene, slot, path->start + arrival->t * path_direction(scene, slot));
        event = EVENT_COLLISION;
    }
    to_shade(scene, group, slot, event);
}

#endif

#endif
