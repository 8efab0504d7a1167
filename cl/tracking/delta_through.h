/* Delta tracking that goes on behind the collision, to estimate the transmittance of the whole stretch: ratio tracking
   at the same tentative collisions (background "expected").

   Given these, the flight gets through with just the probability that the product of 1 - sigma_t / sigma_maj says, so
   that the two differ by nothing on the mean, and by little where majorants are close. */
#include "tracking/collision.h"
#include "tracking/flight.h"
#include "tracking/lanes.h"
#include "tracking/transmittance.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    bool collided = false;
    collision->through = 1.0f;
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float majorant = flight.walk.majorant;
        const float sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        tally->violations += sigma_t > majorant ? 1 : 0;
        collision->through *= (majorant - sigma_t) / majorant;
        const uint2 k = stream_pair(stream);
        if (collided) {
            if (!transmittance_survives(&collision->through, k.x)) {
                collision->through = 0.0f;
                break;
            }
        } else if (choose_event(k.x, sigma_t, majorant - sigma_t)) {
            collided = real_collision(segment_t(&flight.segment), tally, collision);
        }
        flight.depth = exponential_variate(k.y);
    }
    if (collided)
        tally->stopped = 0; /* there is no next leg */
    return collided;
}

#if CLVOL_LANES
#define LANE_COLLIDES 1
#define LANE_FLIES_ON 1 /* walks end by roulette, behind their collisions */

INLINE Int lane_event(LaneState *state, Real density, Bits k, Int ready)
{
    const Int before = state->happened;
    const Int collides = ready & ~before & lane_chooses(k, density, state->bound - density);
    const Real through = state->estimate * ((state->bound - density) / state->bound);
    const Int small = ready & before & MASK(through < TRANSMITTANCE_ROULETTE);
    const Int lost = small & ~MASK(lane_uniform(k) * TRANSMITTANCE_ROULETTE < through);
    const Real kept = either(small, either(lost, (Real)(0.0f), (Real)(TRANSMITTANCE_ROULETTE)), through);
    state->estimate = either(ready, kept, state->estimate);
    state->met = either(collides, state->t, state->met);
    state->happened |= collides;
    return lost;
}
#endif
