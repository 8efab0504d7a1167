/* A path's ray, and how far along it walks go. */
#ifndef CLVOL_PATH_RAY_H
#define CLVOL_PATH_RAY_H
#include "core/scene.h"
#include "path/camera.h"

INLINE Ray path_ray(const Scene *scene, uint slot)
{
    Ray ray;
    ray.o = path_origin(scene, slot);
    ray.d = path_direction(scene, slot);
    return ray;
}

/* A camera ray meets nothing beyond the far plane, and enters nothing there. */
INLINE float ray_limit(const Scene *scene, uint slot, Ray ray)
{
    if (path_bounce(scene, slot) > 0)
        return INFINITY;
#if CLVOL_HAS_METER
    return INFINITY;
#else
    return camera_reach(scene, ray.d);
#endif
}

/* Where the segment of the ray ends that walks go along: at a surface, or, since beyond the far plane no boundary
   is met that might end a medium, there. */
INLINE float segment_end(const Scene *scene, uint slot, Ray ray)
{
    const float reach = path_hit_t(scene, slot);
    return CLVOL_BOUNDARY_WORDS > 0 ? min_of(reach, ray_limit(scene, slot, ray)) : reach;
}

#endif
