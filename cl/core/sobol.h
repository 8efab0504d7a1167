/* Samplers "sobol" and "joint": each block of decisions takes its numbers from a Sobol' sequence in four dimensions,
   with a pixel's samples in an order of its own and Owen-scrambled anew (clvol/tables/sobol.py), so that samples cover
   each decision evenly.

   Every number alone is exactly uniform and independent of the others of its path: no mean changes.
   A pixel's samples are dealt in turn to parts, whose scatter says how large the error is (clvol/picture/estimate.py).
   With "sobol" each part is scrambled on its own: a part's samples depend on each other, parts do not.  With "joint"
   the parts are pieces of one scrambled sequence: together they cover decisions as evenly as one part of as many
   samples would.  But the choice among lights is each part's own: what a light brings hangs on the flight before, and
   no order of a turn's points pairs all of its binary digits unlike those of the flight (see part_in_turn). */
#ifndef CLVOL_CORE_SOBOL_H
#define CLVOL_CORE_SOBOL_H
#include "core/lane_random.h"
#include "core/random.h"
#include "core/scene.h"

/* The order that each block's points are dealt to parts in, two bits each. */
#define BLOCK_ORDERS \
    (2u << 2 * BLOCK_CAMERA | 0u << 2 * BLOCK_WALK | 2u << 2 * BLOCK_LIGHT | 2u << 2 * BLOCK_DIRECTION | \
     0u << 2 * BLOCK_SHADOW | 1u << 2 * BLOCK_SURFACE | 1u << 2 * BLOCK_GLOW)
#define SOBOL_SHUFFLED 0x3FFu /* samples are put in another order within runs of so many and one */

/* Owen's nested uniform scrambling of a number whose bits x has in reverse: a bit is flipped by a function of the
   seed and of the bits before it (Laine and Karras 2011, with Burley's constants).  Uniform seeds give uniform
   numbers. */
#define DEFINE_SCRAMBLE(reverse_bits, owen_scramble, part_in_turn, Bits) \
    INLINE Bits reverse_bits(Bits x) \
    { \
        x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1); \
        x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2); \
        x = ((x >> 4) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4); \
        x = ((x >> 8) & 0x00FF00FFu) | ((x & 0x00FF00FFu) << 8); \
        return (x >> 16) | (x << 16); \
    } \
    INLINE Bits owen_scramble(Bits x, Bits seed) \
    { \
        x += seed; \
        x ^= x * 0x6C50B47Cu; \
        x ^= x * 0xB82F1E52u; \
        x ^= x * 0xC7AFE638u; \
        x ^= x * 0x8D22F6E6u; \
        return x; \
    } \
    /* Which of the four points of a turn a part takes.  The three orders pair the halves of the numbers in three ways. \
       Where numbers of two blocks decide together, parts covary by the product of their covariances in each block:     \
       positively if both pair alike, else negatively, which lowers the variance of all parts together.  So blocks that \
       meet around a scattering differ: the flight to it, its light, its direction and the next flight. */ \
    INLINE Bits part_in_turn(Bits part, Bits bounce, Bits block, Bits segment) \
    { \
        const Bits order = 2u * bounce + segment + (((Bits)(BLOCK_ORDERS) >> (2u * block)) & 3u); \
        return ((Bits)(0x9C78E4u) >> (8u * (order % 3u) + 2u * part)) & 3u; \
    }
DEFINE_SCRAMBLE(reverse_bits, owen_scramble, part_in_turn, uint)
#if CLVOL_LANES
DEFINE_SCRAMBLE(reverse_lanes, owen_scramble_lanes, lane_part_in_turn, Bits)
#endif

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
    const uint dealt = turn * CLVOL_RANDOMIZATIONS + part_in_turn(part, key.bounce, block, segment);
    uint4 point = sobol_point(scene, CLVOL_JOINT ? dealt : turn);
    if (block == BLOCK_LIGHT || block == BLOCK_SURFACE)
        point = point.zxyw; /* the best pair is for a light's point, or the direction */
    uint4 scramble = philox4x32((uint4)(key.pixel, randomization, number, segment), seed);
    if (CLVOL_JOINT && block == BLOCK_LIGHT)
        scramble.x = mixed_bits(scramble.x ^ part);
    return (uint4)(reverse_bits(owen_scramble(point.x, scramble.x)), reverse_bits(owen_scramble(point.y, scramble.y)),
                   reverse_bits(owen_scramble(point.z, scramble.z)), reverse_bits(owen_scramble(point.w, scramble.w)));
}

#if CLVOL_LANES
/* As decision_block, in lanes. */
INLINE BitsBlock lane_decisions(const Scene *scene, const LaneKeys *keys, Bits block, Bits segment)
{
    const uint2 seed = (uint2)(scene->render->seed[0], scene->render->seed[1]);
    const Bits part = keys->sample % CLVOL_RANDOMIZATIONS, index = keys->sample / CLVOL_RANDOMIZATIONS;
    const Bits randomization = CLVOL_JOINT ? (Bits)(0u) : part;
    const Bits number = keys->bounce * 8u + block;
    const Bits seeds = mixed_lanes(seed.x ^ mixed_lanes(seed.y ^ randomization));
    const Bits hash = mixed_lanes(keys->pixel ^ mixed_lanes(number ^ (segment << 16) ^ seeds));
    const Bits order = reverse_lanes(owen_scramble_lanes(reverse_lanes(index), hash));
    const Bits turn = (order & SOBOL_SHUFFLED) | (index & ~SOBOL_SHUFFLED);
    const Bits dealt = turn * CLVOL_RANDOMIZATIONS + lane_part_in_turn(part, keys->bounce, block, segment);
    Bits left = CLVOL_JOINT ? dealt : turn;
    const Bits none = (Bits)(0u);
    BitsBlock point = {none, none, none, none};
    __global const uint *digits = scene->sobol;
    for (; lanes_of(MASK(left != 0u)) != 0; left >>= 4, digits += 16 * 4) {
        const Int at = bits_int(left & 15u) * 4;
        point.x ^= gather_bits(digits, at);
        point.y ^= gather_bits(digits + 1, at);
        point.z ^= gather_bits(digits + 2, at);
        point.w ^= gather_bits(digits + 3, at);
    }
    const Int turned = MASK(block == BLOCK_LIGHT) | MASK(block == BLOCK_SURFACE);
    const BitsBlock as_drawn = point;
    point.x = turned ? as_drawn.z : as_drawn.x;
    point.y = turned ? as_drawn.x : as_drawn.y;
    point.z = turned ? as_drawn.y : as_drawn.z;
    BitsBlock scramble = {keys->pixel, randomization, number, segment};
    scramble = philox_lanes(scramble, seed);
    if (CLVOL_JOINT)
        scramble.x = either_bits(MASK(block == BLOCK_LIGHT), mixed_lanes(scramble.x ^ part), scramble.x);
    point.x = reverse_lanes(owen_scramble_lanes(point.x, scramble.x));
    point.y = reverse_lanes(owen_scramble_lanes(point.y, scramble.y));
    point.z = reverse_lanes(owen_scramble_lanes(point.z, scramble.z));
    point.w = reverse_lanes(owen_scramble_lanes(point.w, scramble.w));
    return point;
}
#endif

#endif
