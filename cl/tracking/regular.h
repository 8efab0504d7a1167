/* Regular tracking: the free flight by inverting the exact optical depth, segment by segment; no tentative
   collisions, no noise but that of the distance itself (Sutton et al. 1999; METHODS §3).

   Emission is gathered at the collision, but along the way where the medium is thin.

   The majorant only tells where the medium is empty.  Several channels: the flight is drawn from one and
   weighted over the mixture (tracking/channels.h). */
#include "density/segments.h"
#include "majorant/majorant.h"
#include "tracking/channels.h"
#include "tracking/collision.h"

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
        if (!(next > lower && next < upper)) /* also where the slope is 0 */
            next = 0.5f * (lower + upper);
        if (abs_of(next - w) <= 1e-6f * next)
            break;
        w = next;
    }
    return w;
}

/* Optical depth, of the channel that has most, up to which emission is gathered along the way: thin media have hardly
   a collision to gather it at.  Beyond, collisions gather it with less noise. */
#define TRACK_DEPTH 0.01f

/* The segments of a flight that end within TRACK_DEPTH, of which one is drawn in proportion to its optical depth. */
typedef struct {
    float total;     /* of their optical depths */
    float t, length; /* the segment drawn, as far as the flight goes */
    float part;      /* its optical depth */
    Extinction depth; /* up to it */
} Track;

INLINE bool is_tracked(Extinction depth_after)
{
    return CLVOL_EMISSION_ON_WALKS && extinction_max(depth_after) <= TRACK_DEPTH;
}

INLINE void track_add(Track *track, float t, float length, Extinction depth, Extinction part, Stream *stream)
{
    const float size = extinction_max(part);
    if (choose_event(stream_pair(stream).x, size, track->total)) {
        track->t = t;
        track->length = length;
        track->part = size;
        track->depth = depth;
    }
    track->total += size;
}

/* Gathers the emission of the track, estimated at one point; collision->beta is still that of the flight's start.
   A flight gets there with the transmittance as its probability, or the mixture of them that `balanced` weights by. */
INLINE void gather_track(const MediumRay *in, const Track *track, Stream *stream, Tally *tally, Collision *collision)
{
    if (!(track->total > 0.0f))
        return;
    const float t = track->t + uniform_float(stream_pair(stream).x) * track->length;
    const float3 start = in->index_ray.o + track->t * in->index_ray.d;
    const Extinction sigma_t = extinction_at(in, in->index_ray.o + t * in->index_ray.d, stream, tally);
    Spectrum beta = collision->beta;
#if CLVOL_EXTINCTION == 3
    LatticeWalk flown;
    flown.t = 0.0f;
    flown.t_end = t - track->t;
    beta = balanced(beta, (Extinction)(1.0f), track->depth + segment_depth(in, start, &flown, stream, tally));
#endif
    collect_emission(in, t, beta * (sigma_t * (track->length * track->total / track->part)), collision);
}

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    const float target = exponential_variate(first);
    const int channel = pick_channel(collision->beta, stream_pair(stream));
    Extinction depth = (Extinction)(0.0f);
    Track track = {0.0f, 0.0f, 0.0f, 0.0f, (Extinction)(0.0f)};
    uint steps = WALK_STEPS;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        tally->cells += 1;
        if (walk.majorant == 0.0f)
            continue;
        const float3 start = in->index_ray.o + walk.t * in->index_ray.d;
        LatticeWalk segment = segments_begin(in, walk.t, walk.t_end);
        while (lattice_next(&segment)) {
            const Extinction part = segment_depth(in, start, &segment, stream, tally);
            if (channel_of(depth + part, channel) >= target) {
                const Cubic cubic = segment_cubic(in, start, &segment, stream, tally);
                const float unit = 0.125f * (segment.t_end - segment.t);
                const float w = invert_cubic(&cubic, channel, (target - channel_of(depth, channel)) / unit);
                const float t = walk.t + segment.t + w * unit;
                const Extinction integral = cubic_integral(&cubic, w);
                const bool tracked = is_tracked(depth + part);
                if (tracked)
                    track_add(&track, walk.t + segment.t, w * unit, depth, unit * integral, stream);
                gather_track(in, &track, stream, tally, collision);
                depth += unit * integral;
                collision->beta = balanced(collision->beta, cubic_value(&cubic, w), depth);
                if (!tracked)
                    collect_emission(in, t, collision->beta, collision);
                tally->tentative += 1;
                return real_collision(t, tally, collision);
            }
            if (is_tracked(depth + part))
                track_add(&track, walk.t + segment.t, segment.t_end - segment.t, depth, part, stream);
            depth += part;
            if (--steps == 0) {
                stop_walk(walk.t + segment.t_end, tally);
                break;
            }
        }
        if (steps == 0)
            break;
    }
    gather_track(in, &track, stream, tally, collision);
    collision->beta = balanced(collision->beta, (Extinction)(1.0f), depth);
    return false;
}
