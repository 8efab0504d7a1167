/* Delta (Woodcock) tracking: a real collision is found by rejection against the majorant.

   Estimates the free-flight distance in the medium, exactly distributed: density sigma_t T, no weight.
   Woodcock et al. 1965; METHODS §3. */
#include "tracking/collision.h"
#include "tracking/flight.h"
#include "tracking/lanes.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float majorant = flight.walk.majorant;
        const float t = segment_t(&flight.segment);
        const float sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        tally->violations += sigma_t > majorant ? 1 : 0;
        collect_emission(in, t, collision->beta * (sigma_t / majorant), collision);
        const uint2 k = stream_pair(stream);
        if (choose_event(k.x, sigma_t, majorant - sigma_t))
            return real_collision(t, tally, collision);
        flight.depth = exponential_variate(k.y);
    }
    return false;
}

#if CLVOL_LANES
#define LANE_COLLIDES 1 /* walks end by real collisions */
#define LANE_FLIES_ON 0

INLINE Int lane_event(LaneState *state, Real density, Bits k, Int ready)
{
    return ready & lane_chooses(k, density, state->bound - density);
}
#endif
