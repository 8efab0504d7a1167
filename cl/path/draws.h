/* The random numbers that a path decides by, where a stage knows which ones before it handles the path: in lanes they
   are drawn for a packet of paths at once (kernels/packets.cl), which costs a fraction.  They are the same numbers. */
#ifndef CLVOL_PATH_DRAWS_H
#define CLVOL_PATH_DRAWS_H
#include "core/sampler.h"
#include "core/scene.h"

/* Of a path, by its stage: the numbers of a block of its own, and those of the next bounce, as far as DRAWS_DIRECTION
   and DRAWS_LIGHT of the stage say that it reads them. */
typedef struct {
    SampleKey key;
    uint block, segment; /* of its own block, which the stage says */
#if CLVOL_LANES
    const BitsBlock *drawn; /* its own, BLOCK_DIRECTION and BLOCK_LIGHT, as far as the stage draws them */
    uint lane;
#endif
} Draws;

/* Four numbers for BLOCK_DIRECTION or BLOCK_LIGHT of the next bounce, or for the path's own block. */
INLINE uint4 drawn_block(const Scene *scene, const Draws *draws, uint block)
{
    const bool next = block == BLOCK_DIRECTION || block == BLOCK_LIGHT;
#if CLVOL_LANES
    const BitsBlock *drawn = draws->drawn + (next ? (block == BLOCK_LIGHT ? 2 : 1) : 0);
    const uint lane = draws->lane;
    return (uint4)(lane_uint(drawn->x, lane), lane_uint(drawn->y, lane), lane_uint(drawn->z, lane),
                   lane_uint(drawn->w, lane));
#else
    SampleKey key = draws->key;
    key.bounce += next ? 1u : 0u;
    return decision_block(scene, key, block, next ? 0u : draws->segment);
#endif
}

#endif
