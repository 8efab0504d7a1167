/* Ratio tracking: an unbiased estimate of transmittance, the product of 1 - sigma_t / sigma_maj over
   tentative collisions (Novák, Selle, Jarosz 2014; METHODS §4).  Factors are not clamped: below a bound
   that is too low they turn negative, and the mean stays right. */
#include "tracking/transmittance.h"

INLINE Extinction estimate_transmittance(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
    Extinction transmittance = (Extinction)(1.0f);
    float depth = exponential_variate(first);
    uint budget = WALK_BUDGET;
    MajorantWalk walk = majorant_begin(in);
    while (majorant_next(in, &walk)) {
        const float majorant = walk.majorant;
        Stretch stretch = stretch_of(in, walk.t, walk.t_end, majorant);
        tally->cells += 1;
        while (next_tentative(&stretch, &depth, tally)) {
            const Extinction sigma_t = extinction_at(in, stretch_point(in, &stretch), stream, tally);
            tally->violations += extinction_max(sigma_t) > majorant ? 1 : 0;
            transmittance *= (majorant - sigma_t) / majorant;
            const uint2 k = stream_pair(stream);
            if (!transmittance_survives(&transmittance, k.x))
                return (Extinction)(0.0f);
            if (--budget == 0) {
                tally->exhausted += 1;
                return (Extinction)(0.0f);
            }
            depth = exponential_variate(k.y);
        }
    }
    return transmittance;
}
