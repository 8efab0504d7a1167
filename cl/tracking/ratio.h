/* Ratio tracking: an unbiased estimate of transmittance, the product of 1 - sigma_t / sigma_maj over
   tentative collisions (Novák, Selle, Jarosz 2014; METHODS §4).  Factors are not clamped: below a bound
   that is too low they turn negative, and the mean stays right. */
#include "tracking/flight.h"
#include "tracking/lanes.h"
#include "tracking/transmittance.h"

INLINE Extinction estimate_transmittance(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
    Extinction transmittance = (Extinction)(1.0f);
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float majorant = flight.walk.majorant;
        const Extinction sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        tally->violations += extinction_max(sigma_t) > majorant ? 1 : 0;
        transmittance *= (majorant - sigma_t) / majorant;
        const uint2 k = stream_pair(stream);
        if (!transmittance_survives(&transmittance, k.x))
            return (Extinction)(0.0f);
        RECORD_ESTIMATE(segment_t(&flight.segment), transmittance, tally);
        flight.depth = exponential_variate(k.y);
    }
    return transmittance;
}

#if CLVOL_LANES
#define LANE_COLLIDES 0 /* walks end by roulette */
#define LANE_FLIES_ON 0

INLINE Int lane_event(LaneState *state, Real density, Bits k, Int ready)
{
    const Real before = state->estimate, after = before * ((state->bound - density) / state->bound);
    const Real size = after < 0.0f ? -after : after, survivor = (Real)(TRANSMITTANCE_ROULETTE);
    const Int small = ready & MASK(size < TRANSMITTANCE_ROULETTE);
    const Int lost = small & ~MASK(lane_uniform(k) * TRANSMITTANCE_ROULETTE < size);
    const Real kept = either(small, after < 0.0f ? -survivor : survivor, after);
    state->estimate = either(ready, either(lost, (Real)(0.0f), kept), before);
    return lost;
}
#endif
