/* Delta (Woodcock) tracking: a real collision is found by rejection against the majorant.

   Estimates the free-flight distance in the medium, exactly distributed: density sigma_t T, no weight.
   Woodcock et al. 1965; METHODS §3. */
#include "tracking/collision.h"
#include "tracking/walk.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    float depth = exponential_variate(first);
    uint budget = WALK_BUDGET;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        const float majorant = walk.majorant;
        Stretch stretch = stretch_of(in, walk.t, walk.t_end, majorant);
        tally->cells += 1;
        while (next_tentative(&stretch, &depth, tally)) {
            const float t = stretch.begin + stretch.t;
            const float sigma_t = extinction_at(in, stretch_point(in, &stretch), stream, tally);
            tally->violations += sigma_t > majorant ? 1 : 0;
            collect_emission(in, t, collision->beta * (sigma_t / majorant), collision);
            const uint2 k = stream_pair(stream);
            if (choose_event(k.x, sigma_t, majorant - sigma_t))
                return real_collision(t, tally, collision);
            if (--budget == 0) {
                tally->exhausted += 1;
                return false;
            }
            depth = exponential_variate(k.y);
        }
    }
    return false;
}
