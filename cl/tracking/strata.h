/* Strata of an exact flight: where it would have collided for each of CLVOL_FLIGHT_STRATA numbers, evenly spaced.

   The share 1 - T of the light that is caught on the way is cut into strata of equal size.  One point is drawn in each,
   at the same place of all: each alone is distributed as the flight's collision, which is one of them, and their mean
   has a fraction of the noise.  The walk goes on behind the collision to the last point: its stratum's upper end is the
   end of all light, so that nothing is cut off, however thick the medium. */
#ifndef CLVOL_TRACKING_STRATA_H
#define CLVOL_TRACKING_STRATA_H
#include "core/random.h"
#include "tracking/interface.h"

typedef struct {
    uint collision; /* the number that decides the flight */
    uint number;    /* of the next point */
    uint spacing;   /* of numbers, mod 2^32: 0 for a single one */
    float share;    /* of the light that a point stands for */
    float target;   /* optical depth of the next point */
    bool left;      /* there is one */
} Strata;

/* Media that do not emit have nothing to gather. */
INLINE bool has_strata(const MediumRay *in) { return CLVOL_FLIGHT_STRATA > 1 && in->medium->emits; }

INLINE Strata strata_begin(const MediumRay *in, uint first)
{
    Strata strata;
    const bool several = has_strata(in);
    strata.collision = first;
    strata.spacing = several ? (uint)(0x100000000ul / CLVOL_FLIGHT_STRATA) : 0;
    strata.share = several ? 1.0f / CLVOL_FLIGHT_STRATA : 1.0f;
    strata.number = first & (strata.spacing - 1u);
    strata.target = exponential_variate(strata.number);
    strata.left = true;
    return strata;
}

/* Whether the point at hand is the collision. */
INLINE bool strata_collide(const Strata *strata) { return strata->number == strata->collision; }

/* Moves on to the next point; whether there is one. */
INLINE bool strata_next(Strata *strata)
{
    strata->number += strata->spacing;
    strata->left = strata->number > strata->spacing - 1u; /* else it has come round */
    strata->target = exponential_variate(strata->number);
    return strata->left;
}

#endif
