/* Homogeneous media: the analytic rules, no majorant and no look-up. */
#ifndef CLVOL_TRACKING_HOMOGENEOUS_H
#define CLVOL_TRACKING_HOMOGENEOUS_H
#include "tracking/interface.h"

INLINE bool homogeneous_collision(float sigma_t, float t_max, uint first, Collision *collision)
{
    collision->t = exponential_variate(first) / sigma_t; /* infinite for vacuum */
    return collision->t < t_max;
}

INLINE float homogeneous_transmittance(float sigma_t, float t_max)
{
    return exp(-sigma_t * t_max);
}

#endif
