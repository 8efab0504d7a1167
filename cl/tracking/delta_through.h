/* Delta tracking that goes on behind collisions, to the end of the stretch (background "expected").

   At the tentative collisions i of a walk at rate sigma_maj, with P_i = sigma_t / sigma_maj and
   w_i = product over j < i of (1 - P_j), it estimates

       T = product of (1 - P_i)              the transmittance of the stretch (ratio tracking),
       R = sum of w_i P_i                    the chance of a collision, 1 - T on the mean,
       S = sum of w_i P_i lit_i              the same in the light of a sun, as the cache of lights has it,

   and keeps one of them, i with the probability w_i P_i / R: from the first on, each replaces the one before with its
   share of the sum so far.  A path that goes on from there with the weight R is on the mean what delta tracking
   makes of it, and what one goes on with less often and more weight too (stages/background.h).  The more tentative collisions,
   the less noise in these sums; `rate` / `scale` of the ray says by how much the walk's rate exceeds the majorant. */
#include "tracking/collision.h"
#include "tracking/flight.h"
#include "tracking/lanes.h"
#if CLVOL_SUN_CONTROL
#include "emitter/sunlit.h"
#endif

/* A walk that gets through with less than this probability stops: the path goes on from the chosen collision, or with that
   probability from there, with its own weight.  (Roulette would let R, and so the weights of long paths, grow.) */
#define LEAST_THROUGH 0.1f

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    Expected *expected = &collision->expected;
    const Expected nothing = {1.0f, 0.0f, 0.0f, 0.0f};
    *expected = nothing;
#if CLVOL_SUN_CONTROL
    const Sunlit sunlit = sunlit_begin(in->scene);
    const Ray cells = sunlit_ray(in->scene, in->world_ray);
#endif
    bool met = false;
    float at = 0.0f;
    Flight flight = flight_begin(in, first);
    while (flight_next(in, &flight, tally)) {
        const float sigma_t = segment_extinction(in, &flight.segment, stream, tally);
        const float chance = sigma_t / flight.walk.majorant, t = segment_t(&flight.segment);
        tally->violations += chance * in->rate > in->scale ? 1 : 0;
        const float part = expected->through * chance;
#if CLVOL_SUN_CONTROL
        const float lit = sunlit_at(&sunlit, cells.o + t * cells.d);
#else
        const float lit = 0.0f;
#endif
        expected->through *= (flight.walk.majorant - sigma_t) / flight.walk.majorant;
        expected->caught += part;
        expected->lit += part * lit;
        const uint2 k = stream_pair(stream);
        if (uniform_float(k.x) * expected->caught < part) {
            met = true;
            at = t;
            expected->met_lit = lit;
        }
        if (expected->through < LEAST_THROUGH) {
            stop_walk(t, tally);
            break;
        }
        flight.depth = exponential_variate(k.y);
    }
    return met && real_collision(at, tally, collision);
}

#if CLVOL_LANES
#define LANE_COLLIDES 1
#define LANE_FLIES_ON 1 /* walks stop behind their collisions */

INLINE Int lane_event(LaneState *state, Real density, Bits k, Int ready)
{
    const Real chance = density * state->share / state->bound;
    const Real part = state->estimate * chance, caught = state->caught + part;
    const Int meets = ready & MASK(lane_uniform(k) * caught < part);
    const Real through = state->estimate * (1.0f - chance);
    state->estimate = either(ready, through, state->estimate);
    state->caught = either(ready, caught, state->caught);
    state->lit += either(ready, part * state->here, (Real)(0.0f));
    state->met = either(meets, state->t, state->met);
    state->met_lit = either(meets, state->here, state->met_lit);
    state->happened |= meets;
    return ready & MASK(through < LEAST_THROUGH);
}
#endif
