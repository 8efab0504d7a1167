/* The cache of lights: for every cell of a coarse grid over the heterogeneous media, the transmittance from its middle
   to every light, and of the sky along six axes.  cl/kernels/light_cache.cl fills it.

   It is a guess.  What uses it must have the same mean whatever it holds: it says which shadow rays are worth tracing
   (stages/bounce.h), which light to sample (emitter/emitter.h), and what a control subtracts. */
#ifndef CLVOL_EMITTER_LIGHT_CACHE_H
#define CLVOL_EMITTER_LIGHT_CACHE_H
#if CLVOL_LIGHT_CACHE
#include "core/scene.h"
#include "emitter/irradiance.h"
#include "geometry/span.h"

INLINE bool cache_holds(const Scene *scene, float3 p)
{
    __global const float *lower = scene->light_cache->lower, *upper = scene->light_cache->upper;
    return p.x >= lower[0] && p.y >= lower[1] && p.z >= lower[2] && p.x <= upper[0] && p.y <= upper[1] &&
           p.z <= upper[2];
}

/* Value at p, within the grid, of a table with a number for the middle of every cell. */
INLINE float cache_interpolate(const Scene *scene, __global const float *table, float3 p)
{
    __global const LightCache *cache = scene->light_cache;
    const int nx = cache->size[0], ny = cache->size[1], nz = cache->size[2];
    const float3 q = (p - load_vector(cache->lower)) * cache->cells_per_length - 0.5f;
    const float x = clamp_to(q.x, 0.0f, (float)(nx - 1)), y = clamp_to(q.y, 0.0f, (float)(ny - 1)),
                z = clamp_to(q.z, 0.0f, (float)(nz - 1));
    const int ix = (int)x, iy = (int)y, iz = (int)z;
    const int dx = ix + 1 < nx ? 1 : 0, dy = iy + 1 < ny ? nx : 0, dz = iz + 1 < nz ? nx * ny : 0;
    const float fx = x - (float)ix, fy = y - (float)iy, fz = z - (float)iz;
    __global const float *c = table + (iz * ny + iy) * nx + ix;
    const float lower = lerp(lerp(c[0], c[dx], fx), lerp(c[dy], c[dy + dx], fx), fy);
    const float upper = lerp(lerp(c[dz], c[dz + dx], fx), lerp(c[dz + dy], c[dz + dy + dx], fx), fy);
    return lerp(lower, upper, fz);
}

INLINE float cached_row(const Scene *scene, uint row, float3 p)
{
    __global const LightCache *cache = scene->light_cache;
    const size_t cells = (size_t)(cache->size[0] * cache->size[1] * cache->size[2]);
    return cache_interpolate(scene, scene->light_transmittance + row * cells, p);
}

/* Transmittance from p along d to the environment: of the three nearest axes, weighted so that an axis counts alone. */
INLINE float cached_sky(const Scene *scene, float3 p, float3 d)
{
    const uint row = weighed_lights(scene);
    const float3 share = d * d;
    return share.x * cached_row(scene, row + (d.x < 0.0f ? 1u : 0u), p) +
           share.y * cached_row(scene, row + (d.y < 0.0f ? 3u : 2u), p) +
           share.z * cached_row(scene, row + (d.z < 0.0f ? 5u : 4u), p);
}

/* Transmittance from p along the unit vector d to a point of the light, `distance` away; 1 of lights without a row.
   Of points beyond the grid it is that of the ray's entry there. */
INLINE float cached_transmittance(const Scene *scene, uint light, float3 p, float3 d, float distance)
{
    const int row = weighed_row(scene, light);
    if (row < 0)
        return 1.0f;
    if (!cache_holds(scene, p)) {
        float from = 0.0f, to = distance;
        Ray ray;
        ray.o = p;
        ray.d = d;
        clip_box(ray, load_vector(scene->light_cache->lower), load_vector(scene->light_cache->upper), &from, &to);
        if (!(from < to))
            return 1.0f;
        p += from * d;
    }
    if ((CLVOL_HAS_ENVMAP || (CLVOL_HAS_CONSTANT && !CLVOL_SKY_APART)) && is_environment(scene->emitters + light))
        return cached_sky(scene, p, d);
    return cached_row(scene, (uint)row, p);
}
#endif
#endif
