/* Directions from uniform numbers. */
#ifndef CLVOL_CORE_SAMPLING_H
#define CLVOL_CORE_SAMPLING_H
#include "core/math.h"

/* Orthonormal frame around the unit vector n (Duff et al. 2017). */
INLINE float3 to_frame(float3 n, float x, float y, float z)
{
    const float s = with_sign(1.0f, n.z);
    const float a = -1.0f / (s + n.z), b = n.x * n.y * a;
    const float3 u = (float3)(s * n.x * n.x * a + 1.0f, s * b, -s * n.x);
    const float3 v = (float3)(b, n.y * n.y * a + s, -n.y);
    return x * u + y * v + z * n;
}

INLINE float3 sphere_direction(float u, float v)
{
    const float r = 2.0f * sqrt_of(u * (1.0f - u));
    const float2 turn = cos_sin_turn(v);
    return (float3)(r * turn.x, r * turn.y, 1.0f - 2.0f * u);
}

#endif
