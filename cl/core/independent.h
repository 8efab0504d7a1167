/* Sampler "independent": no number that a path decides by has to do with another. */
#ifndef CLVOL_CORE_INDEPENDENT_H
#define CLVOL_CORE_INDEPENDENT_H
#include "core/lane_random.h"
#include "core/random.h"
#include "core/scene.h"

/* Four numbered dimensions, full 32-bit.  `segment` tells apart the walks of one bounce. */
INLINE uint4 decision_block(const Scene *scene, SampleKey key, uint block, uint segment)
{
    const uint4 counter = (uint4)(key.pixel, key.sample, block_number(key, block), segment);
    return philox4x32(counter, (uint2)(scene->render->seed[0], scene->render->seed[1]));
}

#if CLVOL_LANES
INLINE BitsBlock lane_decisions(const Scene *scene, const LaneKeys *keys, Bits block, Bits segment)
{
    const BitsBlock counter = {keys->pixel, keys->sample, keys->bounce * 8u + block, segment};
    return philox_lanes(counter, (uint2)(scene->render->seed[0], scene->render->seed[1]));
}
#endif

#endif
