/* Emission along the start of an exact flight, where the medium is so thin that it has hardly a collision. */
#ifndef CLVOL_TRACKING_TRACK_H
#define CLVOL_TRACKING_TRACK_H
#include "density/segments.h"
#include "tracking/channels.h"
#include "tracking/collision.h"
#include "tracking/strata.h"

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

/* Gathers the emission of the track, estimated at one point; beta: at the flight's start.  A flight that ends where it
   collides gets there with the transmittance as its probability, or the mixture of them that `balanced` weights by.
   One of several strata always does, and is weighted by the transmittance. */
INLINE void gather_track(const MediumRay *in, Spectrum beta, const Track *track, Stream *stream, Tally *tally,
                         Collision *collision)
{
    if (!(track->total > 0.0f))
        return;
    const float t = track->t + uniform_float(stream_pair(stream).x) * track->length;
    const float3 start = in->index_ray.o + track->t * in->index_ray.d;
    const Extinction sigma_t = extinction_at(in, in->index_ray.o + t * in->index_ray.d, stream, tally);
#if CLVOL_EXTINCTION == 3 || CLVOL_FLIGHT_STRATA > 1
    const SegmentCell cell = segment_cell(in, start, 0.0f, t - track->t, tally);
    const Extinction depth = track->depth + segment_depth(in, &cell);
    if (has_strata(in))
        beta *= exp_of_minus(depth);
    else
        beta = balanced(beta, (Extinction)(1.0f), depth);
#endif
    collect_emission(in, t, beta * (sigma_t * (track->length * track->total / track->part)), collision);
}

#endif
