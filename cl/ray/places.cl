/* What a ray passes: the surfaces in order (t, number, whether it enters), and the span of each medium.
   One work-item; reads origin (3) and direction (3). */
#include "core/scene.h"
#include "geometry/bvh.h"
#include "geometry/span.h"
#include "geometry/surface.h"

__kernel void places(CLVOL_ARGUMENTS, __global const float *given, __global float *hits, __global float *spans,
                     uint media, uint capacity)
{
    const Scene scene = CLVOL_SCENE;
    if (get_global_id(0) > 0)
        return;
    Ray ray;
    ray.o = load_vector(given);
    ray.d = load_vector(given + 3);
    for (uint m = 0; m < media; ++m) {
        Span span;
        medium_span(scene.media + m, ray, 0.0f, INFINITY, &span);
        spans[3 * m] = span.base;
        spans[3 * m + 1] = span.start;
        spans[3 * m + 2] = span.end;
    }
#if CLVOL_HAS_SURFACES
    Hit hit = {0.0f, 0.0f, 0.0f, NO_PRIMITIVE};
    for (uint n = 0; n < capacity; ++n) {
        hit = closest_hit(&scene, ray, hit.t, hit.primitive, INFINITY);
        if (hit.primitive == NO_PRIMITIVE)
            break;
        const Surface surface = hit_surface(&scene, ray, &hit);
        hits[3 * n] = hit.t;
        hits[3 * n + 1] = (float)surface.shape;
        hits[3 * n + 2] = dot_of(surface.ng, ray.d) < 0.0f ? 1.0f : 0.0f;
    }
#endif
}
