/* Regular tracking: the free flight by inverting the exact optical depth, segment by segment; no tentative
   collisions, no noise but that of the distance itself (Sutton et al. 1999; METHODS §3).

   Emission is gathered at the collision, or at strata of the flight (tracking/strata.h), but along the way where the
   medium is thin (tracking/track.h).

   The majorant only tells where the medium is empty.  Several channels: the flight is drawn from one and
   weighted over the mixture (tracking/channels.h). */
#include "density/segments.h"
#include "majorant/majorant.h"
#include "tracking/channels.h"
#include "tracking/collision.h"
#include "tracking/strata.h"
#include "tracking/track.h"

#define NEWTON_STEPS 16

/* Where in [0, 8] the integral of one channel reaches `target`: Newton's method, kept between bounds that
   bisection narrows (METHODS §3). */
INLINE float invert_cubic(const Cubic *cubic, int channel, float target)
{
    float lower = 0.0f, upper = 8.0f;
    const float whole = channel_of(cubic_integral(cubic, upper), channel);
    float w = whole > target ? upper * (target / whole) : upper;
    for (int step = 0; step < NEWTON_STEPS; ++step) {
        const float excess = channel_of(cubic_integral(cubic, w), channel) - target;
        const float slope = channel_of(cubic_value(cubic, w), channel);
        if (excess > 0.0f)
            upper = w;
        else
            lower = w;
        float next = w - excess / slope;
        if (abs_of(next - w) <= 1e-6f * w) /* before bounds are asked: an exact w is one itself */
            break;
        if (!(next > lower && next < upper)) /* also where the slope is 0 */
            next = 0.5f * (lower + upper);
        w = next;
    }
    return w;
}

/* A flight under way. */
typedef struct {
    Spectrum beta;    /* at its start */
    int channel;      /* that it is drawn from */
    Extinction depth; /* flown through */
    Strata strata;
    bool collided;
} ExactFlight;

/* Meets the points of the flight's strata that lie in the cell's segment, which begins at t; returns how far it was
   walked for them: to its end, or to the last point. */
INLINE float meet_points(const MediumRay *in, const SegmentCell *cell, float t, Extinction part, bool tracked,
                         ExactFlight *flight, Extinction *walked, Tally *tally, Collision *collision)
{
    *walked = part;
    const Extinction after = flight->depth + part;
    if (channel_of(after, flight->channel) < flight->strata.target)
        return 2.0f * cell->half_length;
    const Cubic cubic = segment_cubic(in, cell);
    const float unit = 0.25f * cell->half_length;
    do {
        const float rest = flight->strata.target - channel_of(flight->depth, flight->channel);
        const float w = invert_cubic(&cubic, flight->channel, rest / unit);
        const Extinction depth = unit * cubic_integral(&cubic, w);
        const Spectrum beta = balanced(flight->beta, cubic_value(&cubic, w), flight->depth + depth);
        if (!tracked)
            collect_emission(in, t + w * unit, flight->strata.share * beta, collision);
        if (strata_collide(&flight->strata)) {
            flight->collided = true;
            collision->beta = beta;
            tally->tentative += 1;
            real_collision(t + w * unit, tally, collision);
        }
        if (!strata_next(&flight->strata)) {
            *walked = depth;
            return w * unit;
        }
    } while (channel_of(after, flight->channel) >= flight->strata.target);
    return 2.0f * cell->half_length;
}

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    ExactFlight flight;
    flight.beta = collision->beta;
    flight.channel = pick_channel(flight.beta, stream_pair(stream));
    flight.depth = (Extinction)(0.0f);
    flight.strata = strata_begin(in, first);
    flight.collided = false;
    Track track = {0.0f, 0.0f, 0.0f, 0.0f, (Extinction)(0.0f)};
    uint steps = WALK_STEPS;
    MajorantWalk walk = majorant_begin(in);
    while (steps > 0 && flight.strata.left && majorant_next(in, &walk)) {
        tally->cells += 1;
        if (walk.majorant == 0.0f)
            continue;
        const float3 start = in->index_ray.o + walk.t * in->index_ray.d;
        SegmentWalk segment = segments_begin(in, walk.t, walk.t_end);
        while (steps > 0 && flight.strata.left && segments_next(&segment)) {
            const SegmentCell cell = segment_cell(in, start, segment.t, segment.t_end, tally);
            const Extinction part = segment_depth(in, &cell);
            const bool tracked = is_tracked(flight.depth + part);
            Extinction walked;
            const float length = meet_points(in, &cell, walk.t + segment.t, part, tracked, &flight, &walked, tally,
                                             collision);
            if (tracked)
                track_add(&track, walk.t + segment.t, length, flight.depth, walked, stream);
            flight.depth += walked;
            steps -= 1;
        }
        if (steps == 0 && flight.strata.left && !flight.collided) /* one that collided has no next leg */
            stop_walk(walk.t + segment.t_end, tally);
    }
    gather_track(in, flight.beta, &track, stream, tally, collision);
    if (!flight.collided)
        collision->beta = balanced(flight.beta, (Extinction)(1.0f), flight.depth);
    return flight.collided;
}
