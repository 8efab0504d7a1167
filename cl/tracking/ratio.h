/* Ratio tracking: an unbiased estimate of transmittance, the product of 1 - sigma_t / sigma_maj over
   tentative collisions (Novák, Selle, Jarosz 2014; METHODS §4).

   Small products play Russian roulette at the threshold below: survivors carry the threshold's
   weight, so that nothing is truncated. */
#ifndef CLVOL_TRACKING_TRANSMITTANCE_H
#define CLVOL_TRACKING_TRANSMITTANCE_H
#include "tracking/interface.h"

#define RATIO_ROULETTE 0.1f

INLINE float estimate_transmittance(const Scene *scene, __global const Medium *medium, Ray ray, float t_max,
                                           int channel, uint first, Stream *stream, Tally *tally)
{
    __global const Volume *volume = scene->volumes + medium->sigma_t_volume;
    const float scale = medium->sigma_t[0];
    float transmittance = 1.0f;
    float depth = exponential_variate(first);
    MajorantWalk walk = majorant_begin(scene, medium, ray, t_max);
    uint budget = WALK_BUDGET;
    while (majorant_next(scene, medium, &walk)) {
        const float length = walk.t_end - walk.t, majorant = walk.majorant;
        if (majorant * length <= depth) {
            depth -= majorant * length;
            continue;
        }
        const float3 start = ray.o + walk.t * ray.d;
        const float inverse = 1.0f / majorant;
        float t = depth * inverse;
        while (t < length) {
            const float sigma_t = scale * volume_value(scene, volume, start + t * ray.d, channel);
            tally->lookups += 1;
            tally->violations += sigma_t > majorant ? 1 : 0;
            transmittance *= (majorant - sigma_t) * inverse;
            const uint2 k = stream_pair(stream);
            if (abs_of(transmittance) < RATIO_ROULETTE) {
                if (!(uniform_float(k.x) * RATIO_ROULETTE < abs_of(transmittance)))
                    return 0.0f;
                transmittance = with_sign(RATIO_ROULETTE, transmittance);
            }
            if (--budget == 0) {
                tally->exhausted += 1;
                return 0.0f;
            }
            t += exponential_variate(k.y) * inverse;
        }
        depth = (t - length) * majorant;
    }
    return transmittance;
}

#endif
