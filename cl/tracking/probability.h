/* How a path of several channels weighs events it may choose from (METHODS §3, spectral).  The probabilities
   decide the noise and never the mean, since weights are divided by them. */
#ifndef CLVOL_TRACKING_PROBABILITY_H
#define CLVOL_TRACKING_PROBABILITY_H
#include "core/scene.h"

/* An event's probability but for a factor, given its coefficient in every channel. */
INLINE float spectral_rate(float3 beta, float3 coefficient)
{
#if CLVOL_PROBABILITY == PROBABILITY_HISTORY
    return mean3(beta * coefficient);
#elif CLVOL_PROBABILITY == PROBABILITY_AVERAGE
    return mean3(coefficient);
#else
    return largest3(coefficient);
#endif
}

#endif
