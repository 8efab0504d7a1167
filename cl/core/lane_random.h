/* Random numbers of walks in lanes: counter-based, of a walk's 64-bit seed and of how many it has drawn. */
#ifndef CLVOL_CORE_LANE_RANDOM_H
#define CLVOL_CORE_LANE_RANDOM_H
#if CLVOL_LANES
#include "core/lanes.h"
#include "core/random.h"

/* A walk's stream: the seed's low word counts, its high word is the key.  Two walks whose counters meet draw the same
   numbers only if their keys are the same too.  In 32 bits throughout, since lanes multiply no 64. */
typedef struct {
    Bits counter;
    Bits key;
} LaneStream;

typedef struct {
    Bits x, y;
} BitsPair;

/* Four numbers of each lane. */
typedef struct {
    Bits x, y, z, w;
} BitsBlock;

/* Which numbers the lanes' paths read. */
typedef struct {
    Bits pixel, sample, bounce;
} LaneKeys;

/* As philox4x32. */
INLINE BitsBlock philox_lanes(BitsBlock counter, uint2 key)
{
    Bits a = counter.x, b = counter.y, c = counter.z, d = counter.w;
    for (int round = 0; round < 7; ++round) {
        const Bits high = high_product(a, 0xD2511F53u), low = a * 0xD2511F53u;
        a = high_product(c, 0xCD9E8D57u) ^ b ^ key.x;
        b = c * 0xCD9E8D57u;
        c = high ^ d ^ key.y;
        d = low;
        key += (uint2)(0x9E3779B9u, 0xBB67AE85u);
    }
    const BitsBlock block = {a, b, c, d};
    return block;
}

/* Wellons' lowbias32. */
INLINE Bits mixed_lanes(Bits x)
{
    x = (x ^ (x >> 16)) * 0x7FEB352Du;
    x = (x ^ (x >> 15)) * 0x846CA68Bu;
    return x ^ (x >> 16);
}

/* Two full 32-bit numbers, in the lanes of `draws`; the streams of others stay where they are. */
INLINE BitsPair lane_pair(LaneStream *stream, Int draws)
{
    stream->counter += int_bits(draws) & 0x9E3779B9u;
    const Bits mixed = mixed_lanes(stream->counter);
    BitsPair pair = {mixed_lanes(mixed ^ stream->key), mixed_lanes((mixed + stream->key) ^ 0x68BC21EBu)};
    return pair;
}

/* As uniform_float, of the upper 31 bits: lanes convert signed integers only. */
INLINE Real lane_uniform(Bits k) { return to_real(bits_int(k >> 1)) * 0x1p-31f + 0x1p-32f; }

DEFINE_MINUS_LOG(lane_minus_log, Real)

/* As exponential_variate. */
INLINE Real lane_exponential(Bits k)
{
    const Int lower_half = MASK(bits_int(k) >= 0);
    const Real tail = to_real(bits_int(either_bits(lower_half, k, ~k))) * 0x1p-32f + 0x1p-33f;
    const Int near_one = lower_half & MASK(tail < 0.29f);
    const Bits shifted = real_bits(either(lower_half, 1.0f - tail, tail)) - 0x3F3504F3u;
    const Real exponent = either(near_one, (Real)(0.0f), to_real(bits_int(shifted) >> 23));
    const Real r = either(near_one, -tail, bits_real((shifted & 0x007FFFFFu) + 0x3F3504F3u) - 1.0f);
    return lane_minus_log(r, exponent);
}

/* As choose_event. */
INLINE Int lane_chooses(Bits k, Real part, Real rest)
{
    const Int rare = MASK(part <= rest);
    const Int happened = MASK(lane_uniform(k) * (part + rest) < either(rare, part, rest));
    return happened ^ ~rare;
}

#endif

#endif
