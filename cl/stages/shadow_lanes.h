/* Walks of shadow rays through the one medium of a scene, in lanes (kernels/lanes.cl); surfaces in their way are
   opaque. */
#ifndef CLVOL_STAGES_SHADOW_LANES_H
#define CLVOL_STAGES_SHADOW_LANES_H
#if CLVOL_LANES
#include "path/key.h"
#include "path/tally.h"
#include "stages/media.h"
#include "stages/shadow_ray.h"
#include CLVOL_TRANSMITTANCE_HEADER
#include "tracking/lanes.h"

#define LANE_BLOCK BLOCK_SHADOW

INLINE SampleKey lane_key(const Scene *scene, uint slot, uint *segment)
{
    *segment = 0;
    return path_key(scene, slot);
}

INLINE bool lane_begin(const Scene *scene, uint group, uint slot, LaneWalk *walk)
{
    Ray ray = shadow_ray(scene, slot);
    const float reach = path_shadow_distance(scene, slot);
#if CLVOL_HAS_SURFACES
    const Target target = shadow_target(scene, slot, ray, reach);
    if (any_hit(scene, ray, reach, &target)) {
        shadow_arrives(scene, group, slot, (Spectrum)(0.0f));
        return false;
    }
#endif
    const Inside inside = path_shadow_inside(scene, slot);
    const Walked walked = shadow_walked_so_far(scene, slot, 0.0f);
    Span span;
    if (!medium_segment(scene, 0, ray, &inside, walked.t, reach, &span)) {
        shadow_arrives(scene, group, slot, (Spectrum)(1.0f));
        return false;
    }
    ray.o = span_point(&span, ray);
    walk->in = segment_ray(scene, &inside, 0, ray, span.end - span.start, (int)path_channel(scene, slot));
    lane_leg(walk, walked.leg);
    walk->from = span_t(&span);
    return true;
}

INLINE void lane_end(const Scene *scene, uint group, const LanePath *path, const LaneArrival *arrival)
{
    const uint slot = path->slot;
    const Spectrum share = (Spectrum)(arrival->estimate);
    Tally tally = arrival->tally;
    const Walked walked = take_shadow_walked(scene, slot, path->from);
    const bool stopped = goes_on(walked, &tally);
    record_tally(scene, slot, tally);
    if (stopped) {
        set_shadow_walked(scene, slot, walk_on(walked, path->from, tally.stop_t));
        shadow_waits(scene, group, slot, share);
    } else {
        shadow_arrives(scene, group, slot, share);
    }
}

#endif

#endif
