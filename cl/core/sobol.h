/* Samplers "sobol" and "joint": each block of decisions takes its numbers from a Sobol' sequence in four dimensions,
   with a pixel's samples in an order of its own and Owen-scrambled anew (clvol/tables/sobol.py), so that samples cover
   each decision evenly.

   Every number alone is exactly uniform and independent of the others of its path: no mean changes.
   A pixel's samples are dealt in turn to parts, whose scatter says how large the error is (clvol/picture/estimate.py).
   With "sobol" each part is scrambled on its own: a part's samples depend on each other, parts do not.  With "joint"
   the parts are pieces of one scrambled sequence: together they cover decisions as evenly as one part of as many
   samples would. */
#ifndef CLVOL_CORE_SOBOL_H
#define CLVOL_CORE_SOBOL_H
#include "core/random.h"
#include "core/scene.h"

#define SOBOL_SHUFFLED 0x3FFu /* samples are put in another order within runs of so many and one */

INLINE uint reverse_bits(uint x)
{
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4);
    x = ((x >> 8) & 0x00FF00FFu) | ((x & 0x00FF00FFu) << 8);
    return (x >> 16) | (x << 16);
}

/* Owen's nested uniform scrambling of the number whose bits x has in reverse: a bit is flipped by a function of
   the seed and of the bits before it (Laine and Karras 2011, with Burley's constants).  Uniform seeds
   give uniform numbers. */
INLINE uint owen_scramble(uint x, uint seed)
{
    x += seed;
    x ^= x * 0x6C50B47Cu;
    x ^= x * 0xB82F1E52u;
    x ^= x * 0xC7AFE638u;
    x ^= x * 0x8D22F6E6u;
    return x;
}

/* Wellons' lowbias32. */
INLINE uint mixed_bits(uint x)
{
    x = (x ^ (x >> 16)) * 0x7FEB352Du;
    x = (x ^ (x >> 15)) * 0x846CA68Bu;
    return x ^ (x >> 16);
}

/* Number `index` of the sequence, bits reversed. */
INLINE uint4 sobol_point(const Scene *scene, uint index)
{
    __global const uint4 *digits = (__global const uint4 *)scene->sobol; /* aligned, as every buffer's start is */
    uint4 point = (uint4)(0u);
#pragma unroll 1 /* few turns; unrolled it would take a third of all build time */
    for (; index > 0; index >>= 4, digits += 16)
        point ^= digits[index & 15u]; /* vload4 is a call on PoCL */
    return point;
}

/* Which of the four points of a turn a part takes: one of three orders, so that two blocks pair the halves of their
   numbers in different ways twice out of three times. */
INLINE uint part_in_turn(uint part, uint hash) { return (0x9C78E4u >> (8u * (hash % 3u) + 2u * part)) & 3u; }

/* Four numbered dimensions, full 32-bit.  `segment` tells apart the walks of one bounce. */
INLINE uint4 decision_block(const Scene *scene, SampleKey key, uint block, uint segment)
{
    const uint2 seed = (uint2)(scene->render->seed[0], scene->render->seed[1]);
    const uint part = key.sample % CLVOL_RANDOMIZATIONS, index = key.sample / CLVOL_RANDOMIZATIONS;
    const uint randomization = CLVOL_JOINT ? 0u : part;
    const uint number = block_number(key, block);
    const uint place = mixed_bits(number ^ (segment << 16) ^ mixed_bits(seed.x ^ mixed_bits(seed.y ^ randomization)));
    const uint hash = mixed_bits(key.pixel ^ place);
    const uint order = reverse_bits(owen_scramble(reverse_bits(index), hash));
    const uint turn = (order & SOBOL_SHUFFLED) | (index & ~SOBOL_SHUFFLED);
    uint4 point = sobol_point(scene, CLVOL_JOINT ? turn * CLVOL_RANDOMIZATIONS + part_in_turn(part, hash) : turn);
    if (block == BLOCK_LIGHT || block == BLOCK_SURFACE)
        point = point.zxyw; /* the best pair is for a light's point, or the direction */
    const uint4 scramble = philox4x32((uint4)(key.pixel, randomization, number, segment), seed);
    return (uint4)(reverse_bits(owen_scramble(point.x, scramble.x)), reverse_bits(owen_scramble(point.y, scramble.y)),
                   reverse_bits(owen_scramble(point.z, scramble.z)), reverse_bits(owen_scramble(point.w, scramble.w)));
}

#endif
