/* Delta (Woodcock) tracking: a real collision is found by rejection against the majorant.

   Estimates the free-flight distance in the medium, exactly distributed: density sigma_t T, no weight.
   Woodcock et al. 1965; METHODS §3.  Between collisions only the optical depth still to go is kept,
   so that crossing a cell costs no random number. */
#ifndef CLVOL_TRACKING_COLLISION_H
#define CLVOL_TRACKING_COLLISION_H
#include "tracking/interface.h"

INLINE bool sample_collision(const Scene *scene, __global const Medium *medium, Ray ray, float t_max,
                                    uint first, Stream *stream, Tally *tally, Collision *collision)
{
    __global const Volume *volume = scene->volumes + medium->sigma_t_volume;
    const float scale = medium->sigma_t[0];
    float depth = exponential_variate(first); /* optical depth of the majorant still to go */
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
        float t = depth * inverse; /* measured from the cell's entry, to stay fine far along the ray */
        while (t < length) {
            const float sigma_t = scale * volume_value(scene, volume, start + t * ray.d, collision->channel);
            tally->lookups += 1;
            tally->violations += sigma_t > majorant ? 1 : 0;
            const uint2 k = stream_pair(stream);
            if (choose_event(k.x, sigma_t, majorant - sigma_t)) {
                collision->t = walk.t + t;
                return true;
            }
            if (--budget == 0) {
                tally->exhausted += 1;
                return false;
            }
            t += exponential_variate(k.y) * inverse;
        }
        depth = (t - length) * majorant;
    }
    return false;
}

#endif
