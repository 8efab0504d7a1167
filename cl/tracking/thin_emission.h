/* Emission of a segment so thin that hardly a walk meets an event in it: gathered at one point of the segment, drawn
   evenly, instead of at tentative collisions.

   Estimates the integral of T sigma_a L_e over the segment, with the transmittance to the point by ratio tracking
   under the medium's global bound: unbiased for any bound, and of finite relative variance however thin.

   A walk that stops short leaves what is beyond to its next leg, and one that collides before where it would have
   stopped must not count that part, or it would count twice.  It never does: one number places the point, evenly, and
   decides the flight, and 1 - T at a place is at most THIN_DEPTH of its share of the segment.  So a flight that
   collides has its point before any place that it did not get to; for this the bound has to hold. */
#ifndef CLVOL_TRACKING_THIN_EMISSION_H
#define CLVOL_TRACKING_THIN_EMISSION_H
#if CLVOL_EMISSION_ON_WALKS
#include "core/random.h"
#include "medium/emission.h"
#include "tracking/collision.h"
#include "tracking/walk.h"

/* Optical depth under the global bound up to which a segment is thin: ratio tracking then seldom looks up. */
#define THIN_DEPTH 0.3f
/* Tentative collisions before the point, of which most segments have none, beyond which an estimate is given up. */
#define THIN_BUDGET 64u

INLINE float global_rate(const MediumRay *in) { return in->rate * in->medium->bound; }

INLINE bool is_thin(const MediumRay *in) { return global_rate(in) * in->t_max <= THIN_DEPTH; }

/* `first` places the point, */
INLINE float thin_point(const MediumRay *in, uint first) { return uniform_float(first) * in->t_max; }

/* and gathers its emission.  It also decides the flight: sums keep their mean whatever they share. */
INLINE Spectrum thin_emission(const MediumRay *in, uint first, Stream *stream, Tally *tally, Spectrum beta)
{
    const float rate = global_rate(in), t = thin_point(in, first);
    if (!(rate > 0.0f))
        return (Spectrum)(0.0f);
    float at = exponential_variate(stream_pair(stream).x) / rate;
    for (uint n = 0; at < t; ++n) {
        beta *= 1.0f - extinction_at(in, in->index_ray.o + at * in->index_ray.d, stream, tally) / rate;
        at += exponential_variate(stream_pair(stream).x) / rate;
        if (n == THIN_BUDGET) {
            tally->exhausted += 1;
            return (Spectrum)(0.0f);
        }
    }
    const Extinction depth = extinction_at(in, in->index_ray.o + t * in->index_ray.d, stream, tally) * in->t_max;
    return beta * depth * medium_source(in->scene, in->medium, in->world_ray.o + t * in->world_ray.d, in->channel);
}

#endif
#endif
