/* What the transmittance estimators share. */
#ifndef CLVOL_TRACKING_TRANSMITTANCE_H
#define CLVOL_TRACKING_TRANSMITTANCE_H
#include "core/random.h"
#include "tracking/channels.h"
#include "tracking/walk.h"

/* Estimates below this size play Russian roulette: survivors carry it, so that nothing is truncated. */
#define TRANSMITTANCE_ROULETTE 0.1f

/* Plays for a small estimate with the random number k; false when it is lost. */
INLINE bool transmittance_survives(Extinction *transmittance, uint k)
{
    const float size = extinction_max(*transmittance);
    if (size < TRANSMITTANCE_ROULETTE) {
        if (!(uniform_float(k) * TRANSMITTANCE_ROULETTE < size))
            return false;
        *transmittance *= TRANSMITTANCE_ROULETTE / size;
    }
    return true;
}

#endif
