/* Microflakes whose normals are those of an ellipsoid (Heitz, Dupuy, Crassin, Dachsbacher 2015): light is mirrored by
   the flakes that it sees.  A symmetric matrix S says which: across a direction w the flakes of a medium have the area
   sigma(w) = sqrt(w S w), by which its extinction along w is multiplied.

   The table of them has two lower triangles, by rows: L with S = L L^T, and K = (pi sqrt|S|)^(1/4) L^-1.  Then sigma(w) is
   |L^T w|, and the density of normals D(n) = 1 / (pi sqrt|S| (n S^-1 n)^2) is 1 / |K n|^4, without differences of large
   numbers for flat or thin ellipsoids. */
#ifndef CLVOL_PHASE_FLAKES_H
#define CLVOL_PHASE_FLAKES_H
#if CLVOL_PHASE_SGGX
#include "core/sampling.h"
#include "core/scene.h"
#include "phase/kinds.h"

/* Where tables are: made where they are needed, if they differ from place to place. */
#if CLVOL_HAS_VARIED_FLAKES
#define FLAKES const float *
#else
#define FLAKES __global const float *
#endif

#if CLVOL_PHASE_MIXED_SGGX
#define IS_SGGX(lobe) (IS_PHASE(lobe, SGGX) || IS_PHASE(lobe, MIXED_SGGX))
#else
#define IS_SGGX(lobe) IS_PHASE(lobe, SGGX)
#endif

INLINE float3 lower_times(FLAKES m, float3 v)
{
    return (float3)(m[0] * v.x, m[1] * v.x + m[2] * v.y, m[3] * v.x + m[4] * v.y + m[5] * v.z);
}

INLINE float3 transposed_times(FLAKES m, float3 v)
{
    return (float3)(m[0] * v.x + m[1] * v.y + m[3] * v.z, m[2] * v.y + m[4] * v.z, m[5] * v.z);
}

INLINE float flakes_area(FLAKES table, float3 w)
{
    const float3 seen = transposed_times(table, w);
    return sqrt_of(dot_of(seen, seen));
}

/* D(h) / 4 sigma, where h is half-way between where light comes from and where it goes.  Straight on, where every
   normal across the way would do, it is that of one of them. */
INLINE float flakes_pdf(FLAKES table, float3 wo, float3 wi)
{
    float3 h = wi - wo;
    float square = dot_of(h, h);
    if (!(square > 0.0f)) {
        h = to_frame(wo, 1.0f, 0.0f, 0.0f);
        square = 1.0f;
    }
    const float3 k = lower_times(table + 6, h);
    const float ratio = square / dot_of(k, k);
    return 0.25f * ratio * ratio / flakes_area(table, wo);
}

/* Normals as they are seen: L maps the sphere to the ellipsoid's normals, and keeps what is seen of it: a point of the
   hemisphere that faces L^T w, uniform as it is seen from there. */
INLINE float3 flakes_sample(FLAKES table, float3 wo, float u, float v, float *pdf)
{
    const float3 seen = -transposed_times(table, wo);
    const float area = sqrt_of(dot_of(seen, seen)), r = sqrt_of(u);
    const float2 turn = cos_sin_turn(v);
    const float3 point = to_frame(seen / area, r * turn.x, r * turn.y, sqrt_of(max_of(1.0f - u, 0.0f)));
    const float3 n = unit_of(lower_times(table, point));
    const float3 k = lower_times(table + 6, n);
    const float inverse = 1.0f / dot_of(k, k);
    *pdf = 0.25f * inverse * inverse / area;
    return unit_of(wo - 2.0f * dot_of(wo, n) * n);
}

#endif
#endif
