/* The weight of an event that was chosen among several (METHODS §3), for the techniques that change weights. */
#ifndef CLVOL_TRACKING_EVENT_WEIGHT_H
#define CLVOL_TRACKING_EVENT_WEIGHT_H
#include "core/scene.h"

/* What the weight is multiplied by where an event of coefficient `sigma` was chosen at `rate` of `rates`, of
   tentative collisions at `majorant`: sigma / majorant / (rate / rates).  In one channel, and within the bound,
   it is an analog event, whose weight stays the same: products of 1 rounded add up to 3e-4 in 10,000 events. */
INLINE Extinction event_weight(Extinction sigma, float rate, float rates, float majorant)
{
#if CLVOL_EXTINCTION == 3
    return (sigma / majorant) * (rates / rate);
#else
    return sigma >= 0.0f && sigma <= majorant ? 1.0f : copysign(rates / majorant, sigma);
#endif
}

#endif
