/* How walks are cut so that no launch takes long: in legs, each in a wave of its own (see WALK_STEPS). */
#ifndef CLVOL_STAGES_LEGS_H
#define CLVOL_STAGES_LEGS_H
#if CLVOL_HAS_MEDIA
#include "core/random.h"
#include "tracking/interface.h"
#include "tracking/lanes.h"

/* The random numbers of a leg: those of the walk's block, and for later ones what they key. */
INLINE uint4 leg_block(uint4 block, uint leg) { return leg == 0 ? block : philox4x32(block, (uint2)(leg, 0)); }

#if CLVOL_LANES
/* The same of a walk in lanes, which holds its block's numbers. */
INLINE void lane_leg(LaneWalk *walk, uint leg)
{
    if (leg == 0)
        return;
    walk->k = leg_block(walk->k, leg);
    walk->depth = exponential_variate(walk->k.x);
}
#endif

/* Where a walk stands on its ray.  Legs may be shorter than what rounding takes from their sum, so that is kept. */
typedef struct {
    uint leg; /* number of the next one */
    float t;
    float rest;
} Walked;

/* Behind a leg that stopped `by` further on than `from`. */
INLINE Walked walk_on(Walked walked, float from, float by)
{
    const float step = by + (walked.leg > 0 ? walked.rest : 0.0f);
    walked.leg += 1;
    walked.t = from + step;
    walked.rest = step - (walked.t - from);
    return walked;
}

/* Whether a walk stopped short and is to go on; one that has no legs left counts as having met nothing more. */
INLINE bool goes_on(Walked walked, Tally *tally)
{
    if (!tally->stopped)
        return false;
    tally->stopped = walked.leg + 1 < WALK_LEGS;
    tally->exhausted += !tally->stopped;
    return tally->stopped;
}

#endif
#endif
