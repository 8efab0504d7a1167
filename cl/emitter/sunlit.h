/* How much of the strongest sun's light reaches a point of a medium: the transmittance that the cache of lights has in
   the point's cell.  Nobody interpolates: a control variate has the same mean whatever it is, and as little noise. */
#ifndef CLVOL_EMITTER_SUNLIT_H
#define CLVOL_EMITTER_SUNLIT_H
#if CLVOL_SUN_CONTROL
#include "core/lanes.h"
#include "emitter/light_cache.h"

/* The cache's row of the strongest sun: of the first light, or of the last among those that follow; 0 where no sun is
   among the lights that it tells apart. */
INLINE uint sun_row(const Scene *scene)
{
    uint row = weighed_lights(scene) - 1u;
    if (scene->emitters[weighed_light(scene, 0u)].kind == EMITTER_DIRECTIONAL)
        return 0u;
    while (row > 0u && scene->emitters[weighed_light(scene, row)].kind != EMITTER_DIRECTIONAL)
        --row;
    return row;
}

/* That row, and what its cells are found by. */
typedef struct {
    __global const float *transmittance;
    int last[3]; /* cell of an axis */
    int across, layer; /* cells of a row, and of a layer */
} Sunlit;

INLINE Sunlit sunlit_begin(const Scene *scene)
{
    __global const LightCache *cache = scene->light_cache;
    Sunlit sunlit;
    sunlit.across = cache->size[0];
    sunlit.layer = cache->size[0] * cache->size[1];
    sunlit.transmittance = scene->light_transmittance +
                           (size_t)sun_row(scene) * (size_t)(sunlit.layer * cache->size[2]);
    for (int axis = 0; axis < 3; ++axis)
        sunlit.last[axis] = cache->size[axis] - 1;
    return sunlit;
}

/* A ray, in cells. */
INLINE Ray sunlit_ray(const Scene *scene, Ray world)
{
    Ray ray;
    ray.o = (world.o - load_vector(scene->light_cache->lower)) * scene->light_cache->cells_per_length;
    ray.d = world.d * scene->light_cache->cells_per_length;
    return ray;
}

/* At a point, in cells; of points beyond the grid that of the outermost. */
INLINE float sunlit_at(const Sunlit *sunlit, float3 p)
{
    const int x = (int)clamp_to(p.x, 0.0f, (float)sunlit->last[0]);
    const int y = (int)clamp_to(p.y, 0.0f, (float)sunlit->last[1]);
    const int z = (int)clamp_to(p.z, 0.0f, (float)sunlit->last[2]);
    return sunlit->transmittance[z * sunlit->layer + y * sunlit->across + x];
}

#if CLVOL_LANES
INLINE Int lane_sunlit_cell(Real p, int last)
{
    return to_int(least_of(greatest_of(p, (Real)(0.0f)), (Real)((float)last)));
}

INLINE Real lane_sunlit(const Sunlit *sunlit, Real x, Real y, Real z)
{
    const Int row = lane_sunlit_cell(z, sunlit->last[2]) * sunlit->layer +
                    lane_sunlit_cell(y, sunlit->last[1]) * sunlit->across;
    return gather_real(sunlit->transmittance, row + lane_sunlit_cell(x, sunlit->last[0]));
}
#endif

#endif
#endif
