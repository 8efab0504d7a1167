/* Small arithmetic that must cost what the instruction costs.

   PoCL calls its library for min, max, mix, fma, floor, sqrt, dot, cross, normalize, vload3, sin and cos instead of inlining
   them: a third of all instructions of a render of cloud.xml.  Plain expressions compile to single instructions everywhere.  A
   product and a sum in one expression are contracted to a fused multiply-add where there is one. */
#ifndef CLVOL_CORE_MATH_H
#define CLVOL_CORE_MATH_H

#define INLINE static inline __attribute__((always_inline))

#define PI 3.14159265358979323846f
#define INV_FOUR_PI 0.07957747154594767f

/* NaN-free arguments only. */
INLINE float min_of(float a, float b) { return a < b ? a : b; }
INLINE float max_of(float a, float b) { return a > b ? a : b; }
INLINE int min_int(int a, int b) { return a < b ? a : b; }
INLINE int max_int(int a, int b) { return a > b ? a : b; }
INLINE float clamp_to(float x, float lower, float upper) { return min_of(max_of(x, lower), upper); }
INLINE int clamp_int(int x, int lower, int upper) { return min_int(max_int(x, lower), upper); }
INLINE float lerp(float a, float b, float t) { return (b - a) * t + a; }
INLINE float abs_of(float x) { return as_float(as_uint(x) & 0x7FFFFFFFu); }
INLINE float with_sign(float magnitude, float sign)
{
    return as_float((as_uint(magnitude) & 0x7FFFFFFFu) | (as_uint(sign) & 0x80000000u));
}

/* The square root, correctly rounded where OpenCL's is.  PoCL compiles by Clang, whose own is one instruction. */
INLINE float sqrt_of(float x)
{
#ifdef POCL_DEVICE_ADDRESS_BITS
    return __builtin_sqrtf(x);
#else
    return sqrt(x);
#endif
}

INLINE float dot_of(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

INLINE float3 cross_of(float3 a, float3 b)
{
    return (float3)(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/* v of length 1, where v is neither so long nor so short that its square is out of range. */
INLINE float3 unit_of(float3 v) { return v * (1.0f / sqrt_of(dot_of(v, v))); }

/* v of length 1, however long or short it is. */
INLINE float3 direction_of(float3 v)
{
    const float square = dot_of(v, v);
    return square > 1e-30f && square < 1e30f ? v * (1.0f / sqrt_of(square)) : normalize(v);
}

/* Largest integer not above x, cut to the range of the lattices that use it. */
INLINE int floor_int(float x)
{
    const float safe = clamp_to(x, -2.0e9f, 2.0e9f);
    const int whole = (int)safe;
    return whole - (safe < (float)whole ? 1 : 0);
}

/* (cos, sin) of 2 pi v for v in [0, 1]: exact reduction to an eighth of a turn, then Taylor-Chebyshev
   polynomials; absolute error below 1e-7. */
INLINE float2 cos_sin_turn(float v)
{
    const int quadrant = (int)(4.0f * v + 0.5f);
    const float x = (v - 0.25f * (float)quadrant) * (2.0f * PI); /* |x| <= pi/4 */
    const float x2 = x * x;
    const float s = ((-1.9515295891e-4f * x2 + 8.3321608736e-3f) * x2 - 1.6666654611e-1f) * x2 * x + x;
    const float c = ((2.443315711809948e-5f * x2 - 1.388731625493765e-3f) * x2 + 4.166664568298827e-2f) * x2 * x2 -
                    0.5f * x2 + 1.0f;
    const float a = (quadrant & 1) ? s : c, b = (quadrant & 1) ? c : s;
    return (float2)(((quadrant + 1) & 2) ? -a : a, (quadrant & 2) ? -b : b);
}

#endif
