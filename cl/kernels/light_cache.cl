/* Fills the cache of lights (cl/emitter/light_cache.h), once, before the first wave: the mean extinction of every cell,
   and from it the transmittance from the middle of a cell to every light.

   Nothing here has to be exact: whatever the cache holds, the picture's mean is the same. */
#include "density/transfer.h"
#include "density/volume.h"
#include "emitter/light_cache.h"
#if CLVOL_PHASE_SGGX
#include "phase/sggx.h"
#endif
#include "stages/medium_ray.h"

#define CELL_POINTS 2 /* of a cell, along an axis, at which the extinction is looked up */
#define CELL_STEPS 1.0f /* of the march through a cell's edge */

/* Whether a point is inside the shape and the box that bound a medium; of one that surfaces bound, the box alone. */
INLINE bool medium_holds(__global const Medium *medium, float3 p)
{
    bool holds = true;
    if (medium->shape_kind == SHAPE_CUBE)
        holds = largest3(transform_point(medium->shape_from_world, p)) <= 1.0f;
    if (medium->shape_kind == SHAPE_SPHERE) {
        const float3 q = transform_point(medium->shape_from_world, p);
        holds = dot_of(q, q) <= 1.0f;
    }
    if (medium->clipped) {
        const float3 q = transform_point(medium->box_from_world, p);
        for (int axis = 0; axis < 3; ++axis) {
            const float x = axis == 0 ? q.x : (axis == 1 ? q.y : q.z);
            holds = holds && x >= medium->box_lower[axis] && x <= medium->box_upper[axis];
        }
    }
    return holds;
}

/* Extinction of all heterogeneous media at p, in the channel that they attenuate least. */
INLINE float least_extinction(const Scene *scene, float3 p)
{
    float3 extinction = (float3)(0.0f);
    for (uint m = 0; m < scene->render->media; ++m) {
        __global const Medium *medium = scene->media + m;
        if (is_homogeneous(medium) || !medium_holds(medium, p))
            continue;
        __global const Volume *volume = scene->volumes + medium->sigma_t_volume;
        const float3 value = volume_value3(scene, volume, transform_point(volume->world_to_index, p));
#if CLVOL_PHASE_SGGX
        extinction += load_vector(medium->sigma_t) * density3_of(scene, medium, value) * mean_area(scene, medium, p);
#else
        extinction += load_vector(medium->sigma_t) * density3_of(scene, medium, value);
#endif
    }
    return min_of(extinction.x, min_of(extinction.y, extinction.z));
}

INLINE float3 cell_point(const Scene *scene, uint cell, float3 within)
{
    __global const LightCache *cache = scene->light_cache;
    const uint x = cell % (uint)cache->size[0], row = cell / (uint)cache->size[0];
    const uint y = row % (uint)cache->size[1], z = row / (uint)cache->size[1];
    return load_vector(cache->lower) + ((float3)((float)x, (float)y, (float)z) + within) / cache->cells_per_length;
}

/* One work-item a cell: writes its mean extinction. */
__kernel void light_cache_extinction(CLVOL_ARGUMENTS, __global float *extinction, uint count)
{
    const Scene scene = CLVOL_SCENE;
    const uint cell = (uint)get_global_id(0);
    if (cell >= count)
        return;
    float sum = 0.0f;
    for (uint n = 0; n < CELL_POINTS * CELL_POINTS * CELL_POINTS; ++n) {
        const float3 place = (float3)((float)(n % CELL_POINTS), (float)(n / CELL_POINTS % CELL_POINTS),
                                      (float)(n / (CELL_POINTS * CELL_POINTS)));
        sum += least_extinction(&scene, cell_point(&scene, cell, (place + 0.5f) / (float)CELL_POINTS));
    }
    extinction[cell] = sum / (float)(CELL_POINTS * CELL_POINTS * CELL_POINTS);
}

/* Optical depth from p along d, as far as the cells reach or `length`. */
INLINE float coarse_depth(const Scene *scene, __global const float *extinction, float3 p, float3 d, float length)
{
    const float step = 1.0f / (CELL_STEPS * scene->light_cache->cells_per_length);
    float depth = 0.0f;
    for (uint n = 0; n < 4096u; ++n) {
        const float t = ((float)n + 0.5f) * step;
        const float3 at = p + t * d;
        if (t > length || !cache_holds(scene, at))
            break;
        depth += step * cache_interpolate(scene, extinction, at);
    }
    return depth;
}

/* The sides of a cube: +x, -x, +y, and so on. */
INLINE float3 axis_direction(uint side)
{
    const float sign = side & 1u ? -1.0f : 1.0f;
    return (float3)(side < 2u ? sign : 0.0f, side >> 1 == 1u ? sign : 0.0f, side >= 4u ? sign : 0.0f);
}

/* One work-item a cell of a row: a light's, or a direction's of the sky.  Writes the transmittance and, of lights, the
   unoccluded light.  The transmittance of a sky's own row is the mean of its directions, which the host takes. */
__kernel void light_cache_transmittance(CLVOL_ARGUMENTS, __global const float *extinction,
                                        __global float *transmittance, __global float *irradiance, uint count)
{
    const Scene scene = CLVOL_SCENE;
    const uint item = (uint)get_global_id(0);
    if (item >= count)
        return;
    __global const LightCache *cache = scene.light_cache;
    const uint cells = (uint)(cache->size[0] * cache->size[1] * cache->size[2]);
    const uint row = item / cells;
    const float3 p = cell_point(&scene, item % cells, (float3)(0.5f));
    float depth = 0.0f, light = 0.0f;
    if (row < weighed_lights(&scene)) {
        __global const Emitter *emitter = scene.emitters + weighed_light(&scene, row);
        light = light_irradiance(emitter, p);
        float distance = INFINITY;
        const float3 d = light_middle(emitter, p, &distance);
        if (!is_environment(emitter))
            depth = coarse_depth(&scene, extinction, p, d, distance);
    } else {
        depth = coarse_depth(&scene, extinction, p, axis_direction(row - weighed_lights(&scene)), INFINITY);
    }
    transmittance[item] = exp(-depth);
    irradiance[item] = light;
}
