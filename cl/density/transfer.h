/* Transfer functions: what a medium makes of an interpolated value, piecewise linear between points.  They are applied
   after interpolation, and the bounds of majorants are those of the function over the range of a cell's values. */
#ifndef CLVOL_DENSITY_TRANSFER_H
#define CLVOL_DENSITY_TRANSFER_H
#include "core/scene.h"

#if CLVOL_HAS_TRANSFER
/* Whether a medium makes its TRANSFER_SIGMA_T, _ALBEDO or _EMISSION of values. */
INLINE bool is_classified(const Scene *scene, __global const Medium *medium, int role)
{
    return medium->transfer >= 0 && scene->transfers[medium->transfer + role].count > 0;
}

/* The colour of a value: between the last point that it reaches and the next one. */
INLINE float3 classified_colour(const Scene *scene, __global const Medium *medium, int role, float value)
{
    __global const Transfer *transfer = scene->transfers + medium->transfer + role;
    __global const float4 *points = scene->transfer_points + transfer->first;
    uint low = 0, high = transfer->count - 1;
    while (high - low > 1) { /* halves each time */
        const uint middle = (low + high) / 2;
        if (points[middle].x <= value)
            low = middle;
        else
            high = middle;
    }
    const float4 from = points[low], to = points[high];
    const float share = to.x > from.x ? clamp_to((value - from.x) / (to.x - from.x), 0.0f, 1.0f)
                                      : (value >= to.x ? 1.0f : 0.0f);
    return (to.yzw - from.yzw) * share + from.yzw;
}
#endif

/* Density of a value of the medium's volume. */
INLINE float density_of(const Scene *scene, __global const Medium *medium, float value)
{
#if CLVOL_HAS_TRANSFER
    if (is_classified(scene, medium, TRANSFER_SIGMA_T))
        return classified_colour(scene, medium, TRANSFER_SIGMA_T, value).x;
#endif
    return value;
}

/* The same of three channels: what is classified has one. */
INLINE float3 density3_of(const Scene *scene, __global const Medium *medium, float3 value)
{
#if CLVOL_HAS_TRANSFER
    if (is_classified(scene, medium, TRANSFER_SIGMA_T))
        return (float3)(classified_colour(scene, medium, TRANSFER_SIGMA_T, value.x).x);
#endif
    return value;
}

#endif
