/* Crossing the boundaries of media. */
#ifndef CLVOL_STAGES_BOUNDARY_H
#define CLVOL_STAGES_BOUNDARY_H
#if CLVOL_HAS_SURFACES
#include "core/scene.h"
#include "geometry/bvh.h"
#include "geometry/surface.h"

/* Surfaces that one ray may pass before it is given up and counted. */
#define MOST_PASSED 65536u

/* Light that leaves a boundary along d is inside of it if d points behind the normal: said anew at every crossing, so
   that a hit on an edge counts once, and an error of rounding does not outlast the next one. */
INLINE void cross_boundary(__global const Shape *shape, float3 ng, float3 d, Inside *inside)
{
#if CLVOL_BOUNDARY_WORDS > 0
    if (shape->boundary < 0)
        return;
    const uint bit = 1u << (shape->boundary & 31);
    if (dot_of(ng, d) < 0.0f)
        inside->word[shape->boundary >> 5] |= bit;
    else
        inside->word[shape->boundary >> 5] &= ~bit;
#endif
}

#if CLVOL_CAMERA_INSIDE
/* Bits of a ray that starts anywhere: it is inside of a boundary whose first crossing leads out. */
INLINE Inside find_inside(const Scene *scene, Ray ray)
{
    Inside inside, seen;
    for (int w = 0; w < CLVOL_BOUNDARY_WORDS; ++w)
        inside.word[w] = seen.word[w] = 0;
    Hit hit = {0.0f, 0.0f, 0.0f, NO_PRIMITIVE};
    for (uint n = 0; n < MOST_PASSED; ++n) {
        hit = closest_hit(scene, ray, hit.t, hit.primitive, INFINITY);
        if (hit.primitive == NO_PRIMITIVE)
            break;
        const Surface surface = hit_surface(scene, ray, &hit);
        __global const Shape *shape = scene->shapes + surface.shape;
        if (shape->boundary < 0)
            continue;
        const int word = shape->boundary >> 5;
        const uint bit = 1u << (shape->boundary & 31);
        if (!(seen.word[word] & bit) && dot_of(surface.ng, ray.d) > 0.0f)
            inside.word[word] |= bit;
        seen.word[word] |= bit;
    }
    return inside;
}
#endif

#endif
#endif
