/* Transmittance by delta tracking, all or nothing: 1 where no real collision lies in the way, in each
   channel by itself (METHODS §4). */
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
        const Extinction sigma_n = majorant - sigma_t;
        tally->violations += extinction_max(sigma_t) > majorant ? 1 : 0;
        const uint2 k = stream_pair(stream);
#if CLVOL_EXTINCTION == 3
        transmittance.x = choose_event(k.x, sigma_t.x, sigma_n.x) ? 0.0f : transmittance.x;
        transmittance.y = choose_event(k.x, sigma_t.y, sigma_n.y) ? 0.0f : transmittance.y;
        transmittance.z = choose_event(k.x, sigma_t.z, sigma_n.z) ? 0.0f : transmittance.z;
#else
        transmittance = choose_event(k.x, sigma_t, sigma_n) ? 0.0f : transmittance;
#endif
        tally->real += extinction_max(transmittance) > 0.0f ? 0 : 1;
        if (!(extinction_max(transmittance) > 0.0f))
            return transmittance;
        flight.depth = exponential_variate(k.y);
    }
    return transmittance;
}

#if CLVOL_LANES
#define LANE_COLLIDES 1 /* walks end by real collisions */
#define LANE_FLIES_ON 0

INLINE Int lane_event(LaneState *state, Real density, Bits k, Int ready)
{
    const Int real = ready & lane_chooses(k, density, state->bound - density);
    state->estimate = either(real, (Real)(0.0f), state->estimate);
    return real;
}
#endif
