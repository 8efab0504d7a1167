/* Random numbers: counter-based, keyed by (pixel, sample, dimension), never by the ray.

   Path decisions (pixel, light, direction, event, first distance) read *numbered dimensions*, four
   to a block, from the sampler chosen: decision_block() in core/independent.h or core/sobol.h.
   Tracking loops read a *stream* that a block seeds: any number of draws, same counter principle. */
#ifndef CLVOL_CORE_RANDOM_H
#define CLVOL_CORE_RANDOM_H
#include "core/math.h"

/* Blocks of four dimensions within one bounce. */
#define BLOCK_CAMERA 0u    /* pixel x, pixel y, place on the lens (2) */
#define BLOCK_WALK 1u      /* first distance, event, stream seed (2); one block per segment walked */
#define BLOCK_LIGHT 2u     /* light choice, light point (2), whether its shadow ray is traced */
#define BLOCK_DIRECTION 3u /* scattered direction (2), roulette, lobe of the phase function */
#define BLOCK_SHADOW 4u    /* first distance, -, stream seed (2); one block per segment walked */
#define BLOCK_SURFACE 5u   /* opacity, direction (2), lobe of the BSDF; one block per surface met */
#define BLOCK_GLOW 6u      /* points at which a medium's own light is gathered (4); one block per segment walked */

/* Which numbers a path reads: its pixel and sample, and how far along it is. */
typedef struct {
    uint pixel;
    uint sample;
    uint bounce;
} SampleKey;

/* Philox4x32 with 7 rounds (Salmon et al. 2011, the fewest that pass BigCrush). */
INLINE uint4 philox4x32(uint4 counter, uint2 key)
{
    uint a = counter.x, b = counter.y, c = counter.z, d = counter.w, k0 = key.x, k1 = key.y;
    for (int round = 0; round < 7; ++round) { /* in scalars: as vectors it costs twice as much on PoCL */
        const ulong p0 = (ulong)a * 0xD2511F53u, p1 = (ulong)c * 0xCD9E8D57u;
        a = (uint)(p1 >> 32) ^ b ^ k0;
        b = (uint)p1;
        c = (uint)(p0 >> 32) ^ d ^ k1;
        d = (uint)p0;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    return (uint4)(a, b, c, d);
}

/* Where a block's numbers stand among those of a path. */
INLINE uint block_number(SampleKey key, uint block) { return key.bounce * 8u + block; }

/* (k + 1/2) / 2^32: never 0; rounds to 1 only within 2^-25 of it, so compare where that is safe. */
INLINE float uniform_float(uint k) { return (float)k * 0x1p-32f + 0x1p-33f; }

/* As uniform_float, but strictly below 1, for positions and table look-ups. */
INLINE float uniform_below_one(uint k) { return min_of(uniform_float(k), 0x1.fffffep-1f); }

/* Stream of a tracking loop: SplitMix64 read as a counter-based generator (state = seed + n·γ;
   Steele, Lea, Flood 2014). */
typedef struct {
    ulong state;
} Stream;

INLINE Stream stream_begin(uint seed_low, uint seed_high)
{
    Stream stream;
    stream.state = ((ulong)seed_high << 32) | seed_low;
    return stream;
}

/* Two independent full 32-bit numbers: what one tentative collision needs. */
INLINE uint2 stream_pair(Stream *stream)
{
    stream->state += 0x9E3779B97F4A7C15ul;
    ulong z = stream->state;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ul;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBul;
    z ^= z >> 31;
    return (uint2)((uint)z, (uint)(z >> 32));
}

/* -ln of 2^exponent (1 + r), for 1 + r between the roots of 1/2 and 2: Cephes' logf, relative error below 1e-7.
   For numbers of any type, so that lanes share it. */
#define DEFINE_MINUS_LOG(name, Number) \
    INLINE Number name(Number r, Number exponent) \
    { \
        Number poly = 7.0376836292e-2f * r - 1.1514610310e-1f; \
        poly = poly * r + 1.1676998740e-1f; \
        poly = poly * r - 1.2420140846e-1f; \
        poly = poly * r + 1.4249322787e-1f; \
        poly = poly * r - 1.6668057665e-1f; \
        poly = poly * r + 2.0000714765e-1f; \
        poly = poly * r - 2.4999993993e-1f; \
        poly = poly * r + 3.3333331174e-1f; \
        const Number r2 = r * r; \
        const Number log_value = poly * r * r2 - exponent * 2.12194440e-4f - 0.5f * r2 + r; \
        return -(exponent * 0.693359375f + log_value); \
    }

DEFINE_MINUS_LOG(minus_log, float)

/* A normal number, whose bits are `bits`, is (1 + r) 2^exponent: returns r, from sqrt_of(1/2) - 1 to sqrt_of(2) - 1. */
INLINE float split_of_bits(uint bits, float *exponent)
{
    const uint shifted = bits - 0x3F3504F3u;
    *exponent = (float)((int)shifted >> 23);
    return as_float((shifted & 0x007FFFFFu) + 0x3F3504F3u) - 1.0f;
}

/* -ln(x) of a normal number, whose bits are `bits`. */
INLINE float minus_log_of_bits(uint bits)
{
    float exponent;
    const float r = split_of_bits(bits, &exponent);
    return minus_log(r, exponent);
}

/* Exponential variate with mean 1 from a full 32-bit number: -ln(1 - (k+1/2)/2^32), with full relative
   precision at both ends (METHODS §7).  Near 1 the argument of the logarithm is kept as its distance
   from 1. */
INLINE float exponential_variate(uint k)
{
    const bool lower_half = k < 0x80000000u;
    const float tail = (float)(lower_half ? k : ~k) * 0x1p-32f + 0x1p-33f; /* distance to the nearer end */
    const bool near_one = lower_half && tail < 0.29f;
    float exponent;
    const float r = split_of_bits(as_uint(lower_half ? 1.0f - tail : tail), &exponent);
    return minus_log(near_one ? -tail : r, near_one ? 0.0f : exponent);
}

/* Whether an event of rate `part` happens among a total rate `part + rest`, at full resolution for
   the rarer of the two; an event of rate 0 never happens. */
INLINE bool choose_event(uint k, float part, float rest)
{
    const float rarer = min_of(part, rest);
    const bool happened = uniform_float(k) * (part + rest) < rarer;
    return (part <= rest) ? happened : !happened;
}

/* Wellons' lowbias32. */
INLINE uint mixed_bits(uint x)
{
    x = (x ^ (x >> 16)) * 0x7FEB352Du;
    x = (x ^ (x >> 15)) * 0x846CA68Bu;
    return x ^ (x >> 16);
}

#endif
