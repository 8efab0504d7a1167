/* Walks side by side: numbers of CLVOL_LANES walks at once, one in each lane of a vector, or of one walk.

   Where all is one walk the names stand for scalars, so that what is written once computes the same bits at every
   width.  A mask holds all ones where it holds, else 0, and masks combine by & | ~ ^; either() takes one.  Only plain
   operators: PoCL calls its library for the built-in functions of vectors, lane by lane. */
#ifndef CLVOL_CORE_LANES_H
#define CLVOL_CORE_LANES_H
#if CLVOL_LANES
#include "core/math.h"

#if CLVOL_LANES == 1
typedef float Real;
typedef int Int;
typedef uint Bits;
#define MASK(condition) (-(int)(condition))
#define to_int(x) ((int)(x))
#define to_real(x) ((float)(x))
#define real_bits(x) as_uint(x)
#define bits_real(x) as_float(x)
#define bits_int(x) as_int(x)
#define int_bits(x) as_uint(x)
#define gather(p, i) ((p)[i])
#else
#define LANES_JOIN_(a, b) a##b
#define LANES_JOIN(a, b) LANES_JOIN_(a, b)
typedef LANES_JOIN(float, CLVOL_LANES) Real;
typedef LANES_JOIN(int, CLVOL_LANES) Int;
typedef LANES_JOIN(uint, CLVOL_LANES) Bits;
#define MASK(condition) (condition)
#ifdef __clang__ /* whose conversion is one instruction for a vector */
#define to_int(x) __builtin_convertvector(x, Int)
#define to_real(x) __builtin_convertvector(x, Real)
#else
#define to_int(x) LANES_JOIN(LANES_JOIN(convert_int, CLVOL_LANES), _rtz)(x)
#define to_real(x) LANES_JOIN(convert_float, CLVOL_LANES)(x)
#endif
#define real_bits(x) LANES_JOIN(as_uint, CLVOL_LANES)(x)
#define bits_real(x) LANES_JOIN(as_float, CLVOL_LANES)(x)
#define bits_int(x) LANES_JOIN(as_int, CLVOL_LANES)(x)
#define int_bits(x) LANES_JOIN(as_uint, CLVOL_LANES)(x)
#if CLVOL_LANES == 4
#define gather(p, i) ((p)[(uint)(i).s0], (p)[(uint)(i).s1], (p)[(uint)(i).s2], (p)[(uint)(i).s3])
#elif CLVOL_LANES == 8
#define gather(p, i) \
    ((p)[(uint)(i).s0], (p)[(uint)(i).s1], (p)[(uint)(i).s2], (p)[(uint)(i).s3], (p)[(uint)(i).s4], (p)[(uint)(i).s5], \
     (p)[(uint)(i).s6], (p)[(uint)(i).s7])
#else
#define gather(p, i) \
    ((p)[(uint)(i).s0], (p)[(uint)(i).s1], (p)[(uint)(i).s2], (p)[(uint)(i).s3], (p)[(uint)(i).s4], (p)[(uint)(i).s5], \
     (p)[(uint)(i).s6], (p)[(uint)(i).s7], (p)[(uint)(i).s8], (p)[(uint)(i).s9], (p)[(uint)(i).sa], (p)[(uint)(i).sb], \
     (p)[(uint)(i).sc], (p)[(uint)(i).sd], (p)[(uint)(i).se], (p)[(uint)(i).sf])
#endif
#endif

/* One lane of a vector in memory. */
#define set_lane(vector, lane, value) (((float *)&(vector))[lane] = (value))
#define set_lane_int(vector, lane, value) (((int *)&(vector))[lane] = (value))
#define set_lane_uint(vector, lane, value) (((uint *)&(vector))[lane] = (value))
#define lane_of(vector, lane) (((const float *)&(vector))[lane])
#define lane_int(vector, lane) (((const int *)&(vector))[lane])
#define lane_uint(vector, lane) (((const uint *)&(vector))[lane])

/* p[i] in every lane, by loads of its own: the gather instructions of processors are slower.  i is not negative:
   without a sign, which an address would have to be extended by, walks take 3 to 5 % less. */
#define gather_real(p, i) ((Real)gather(p, i))
#define gather_int(p, i) ((Int)gather(p, i))
#define gather_bits(p, i) ((Bits)gather(p, i))

/* Upper half of the product with a number. */
#if CLVOL_LANES == 1
INLINE Bits high_product(Bits x, uint factor) { return (uint)(((ulong)x * factor) >> 32); }
#else
#if CLVOL_LANES == 16
typedef ulong8 WideBits;
#define wide_bits(x) as_ulong8(x)
#elif CLVOL_LANES == 8
typedef ulong4 WideBits;
#define wide_bits(x) as_ulong4(x)
#else
typedef ulong2 WideBits;
#define wide_bits(x) as_ulong2(x)
#endif
INLINE Bits high_product(Bits x, uint factor)
{
    const WideBits pairs = wide_bits(x); /* of two lanes, the even one in the lower half */
    const WideBits even = (pairs & 0xFFFFFFFFul) * factor, odd = (pairs >> 32) * factor;
    return real_bits((even >> 32) | (odd & 0xFFFFFFFF00000000ul));
}
#endif

/* a where a mask holds, b elsewhere: bit by bit, since of a vector's ?: compilers make masks of other widths. */
INLINE Int either_int(Int mask, Int a, Int b) { return (mask & a) | (~mask & b); }
INLINE Bits either_bits(Int mask, Bits a, Bits b) { return (int_bits(mask) & a) | (~int_bits(mask) & b); }
INLINE Real either(Int mask, Real a, Real b) { return bits_real(either_bits(mask, real_bits(a), real_bits(b))); }

/* NaN-free arguments only. */
INLINE Real least_of(Real a, Real b) { return a < b ? a : b; }
INLINE Real greatest_of(Real a, Real b) { return a > b ? a : b; }
INLINE Int least_int(Int a, Int b) { return a < b ? a : b; }
INLINE Real between(Real a, Real b, Real t) { return (b - a) * t + a; }

/* The lanes in which masks hold, a bit each: those of one in the lower half of the bits, of another in the upper. */
INLINE uint lanes_of_two(Int lower, Int upper)
{
#if CLVOL_LANES == 1
    return ((uint)lower & 1u) | ((uint)upper & 0x10000u);
#else
#if CLVOL_LANES == 16
    const int16 bits = (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
    const int16 own = (lower & bits) | (upper & (bits << 16));
    const int8 eight = own.lo | own.hi;
    const int4 four = eight.lo | eight.hi;
#elif CLVOL_LANES == 8
    const int8 bits = (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    const int8 own = (lower & bits) | (upper & (bits << 16));
    const int4 four = own.lo | own.hi;
#else
    const int4 bits = (int4)(1, 2, 4, 8);
    const int4 four = (lower & bits) | (upper & (bits << 16));
#endif
    const int2 two = four.lo | four.hi;
    return (uint)(two.x | two.y);
#endif
}

INLINE uint lanes_of(Int mask) { return lanes_of_two(mask, (Int)(0)); }

#define ALL_LANES ((1u << CLVOL_LANES) - 1u)

/* How many lanes are among some, and the lowest; as instructions where the compiler has them. */
#ifdef __clang__
INLINE uint lane_count(uint lanes) { return (uint)__builtin_popcount(lanes); }
INLINE uint first_lane(uint lanes) { return (uint)__builtin_ctz(lanes); }
#else
INLINE uint lane_count(uint lanes) { return popcount(lanes); }
INLINE uint first_lane(uint lanes) { return popcount((lanes & -lanes) - 1u); }
#endif

#endif

#endif
