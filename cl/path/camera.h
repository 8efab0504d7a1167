/* Rays that leave the camera: where in a pixel, and from where on the lens. */
#ifndef CLVOL_PATH_CAMERA_H
#define CLVOL_PATH_CAMERA_H
#include "core/random.h"
#include "core/sampling.h"
#include "core/scene.h"

/* Offset of the sample from the pixel's corner along one axis, drawn from the pixel filter's magnitude; a filter
   that reaches over the window's edge is cut there and renormalised.  A filter f with negative parts multiplies
   `weight` by sign(f) times the integral of |f| over that of f. */
INLINE float filter_offset(const Scene *scene, uint k, int pixel, int pixels, float *weight)
{
#if CLVOL_HAS_FILTER_TABLE
    __global const float *cdf = scene->filter_cdf;
    const int bins = scene->render->filter_bins;
    const float radius = scene->render->filter_radius;
    const float per_unit = (float)bins / (2.0f * radius);
    float lower = 0.0f, upper = 1.0f;
    float net = CLVOL_HAS_SIGNED_FILTER ? cdf[2 * bins + 1] : 1.0f; /* integral of the filter itself */
    if (!scene->render->sample_border) {
        const float from = clamp_to((radius - 0.5f - (float)pixel) * per_unit, 0.0f, (float)bins);
        const float to = clamp_to((radius - 0.5f + (float)(pixels - pixel)) * per_unit, 0.0f, (float)bins);
        const int a = min_int((int)from, bins - 1), b = min_int((int)to, bins - 1);
        lower = lerp(cdf[a], cdf[a + 1], from - (float)a);
        upper = lerp(cdf[b], cdf[b + 1], to - (float)b);
        if (CLVOL_HAS_SIGNED_FILTER) {
            __global const float *sums = cdf + bins + 1;
            net = lerp(sums[b], sums[b + 1], to - (float)b) - lerp(sums[a], sums[a + 1], from - (float)a);
        }
    }
    const float u = min_of(lerp(lower, upper, uniform_below_one(k)), 0x1.fffffep-1f); /* below the last bin's end */
    int first = 0, last = bins - 1;
    while (first < last) {
        const int middle = (first + last) >> 1;
        if (cdf[middle + 1] > u)
            last = middle;
        else
            first = middle + 1;
    }
    if (CLVOL_HAS_SIGNED_FILTER)
        *weight *= with_sign((upper - lower) / net, cdf[bins + 2 + first] - cdf[bins + 1 + first]);
    const float in_bin = (u - cdf[first]) / (cdf[first + 1] - cdf[first]);
    return 0.5f - radius + ((float)first + in_bin) / per_unit;
#else
    return uniform_float(k);
#endif
}

/* The camera ray of film position (x, y); u and v place it on the lens, uniformly over its disk. */
INLINE Ray camera_ray(const Scene *scene, float x, float y, float u, float v)
{
    __global const Render *render = scene->render;
    Ray ray;
    ray.o = load_vector(render->camera_position) + x * load_vector(render->camera_dx) +
            y * load_vector(render->camera_dy);
    float3 towards = load_vector(render->camera_base) + x * load_vector(render->camera_base_dx) +
                     y * load_vector(render->camera_base_dy);
    if (CLVOL_HAS_LENS) {
        const float2 place = sqrt_of(u) * cos_sin_turn(v);
        const float3 lens = place.x * load_vector(render->lens_x) + place.y * load_vector(render->lens_y);
        ray.o += render->lens_start * lens;
        towards -= render->lens_bend * lens;
    }
    ray.d = unit_of(towards);
    return ray;
}

/* How far it goes: to the far plane. */
INLINE float camera_reach(const Scene *scene, float3 direction)
{
    return scene->render->camera_far / dot_of(direction, load_vector(scene->render->camera_forward));
}

#endif
