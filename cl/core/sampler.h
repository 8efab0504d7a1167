/* Samplers: where a path's decisions get their numbers.  Each header that --sampler names implements

       uint4 decision_block(scene, key, block, segment);

   and, of stages whose paths go in lanes, lane_decisions(scene, &keys, block, segment):
   four numbered dimensions, full 32-bit, for a BLOCK_* of core/random.h; `segment` tells apart the walks of one
   bounce. */
#ifndef CLVOL_CORE_SAMPLER_H
#define CLVOL_CORE_SAMPLER_H
#include CLVOL_SAMPLER_HEADER

#endif
