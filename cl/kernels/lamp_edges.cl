/* Finds, once before the first wave, what camera rays meet on a grid of LAMP_GRID x LAMP_GRID points per pixel: from it
   clvol/rendering/lamp_edges.py knows which pixels a lamp's edge passes.

   Nothing here has to be exact: whatever it finds, the picture's mean is the same. */
#include "bsdf/kinds.h"
#include "stages/lamp_edges.h"

/* Whether light may come through a surface or be mirrored in it, so that what is seen there may be as bright as a lamp. */
INLINE bool shows_lamps(const Scene *scene, const Surface *surface, float3 d)
{
    __global const Shape *shape = scene->shapes + surface->shape;
    const int number = dot_of(surface->ng, d) < 0.0f ? shape->front : shape->back;
    if (number < 0)
        return false;
    __global const Material *material = scene->materials + number;
#if CLVOL_BSDF_BLEND
    if (IS_BSDF(material, BLEND))
        return true;
#endif
    return material_is_smooth(material) || material_transmits(material) || material->opacity_texture >= 0 ||
           material->opacity < 1.0f;
}

/* One work-item a point, counted from row `first_row` on: writes LAMP_NONE, LAMP_UNSURE, or which lamp is seen. */
__kernel void lamp_edges(CLVOL_ARGUMENTS, __global uchar *seen, uint left, uint columns, uint first_row, uint count)
{
    const Scene scene = CLVOL_SCENE;
    const uint point = (uint)get_global_id(0);
    if (point >= count)
        return;
    const float x = ((float)(left + point % columns) + 0.5f) / (float)LAMP_GRID;
    const float y = ((float)(first_row + point / columns) + 0.5f) / (float)LAMP_GRID;
    const Ray ray = camera_ray(&scene, x, y, 0.0f, 0.0f);
    const Hit hit = closest_hit(&scene, ray, 0.0f, NO_PRIMITIVE, camera_reach(&scene, ray.d));
    uint found = LAMP_NONE;
    if (hit.primitive != NO_PRIMITIVE) {
        const Surface surface = hit_surface(&scene, ray, &hit);
        __global const Emitter *lamp = refined_lamp(&scene, &surface, ray.d);
        const uint number = (uint)(lamp - scene.emitters);
        if (lamp && guess_through(&scene, ray, hit.t, number).x >= 0.0f)
            found = 1u + number % (LAMP_UNSURE - 1u);
        else if (lamp || shows_lamps(&scene, &surface, ray.d))
            found = LAMP_UNSURE;
    }
    seen[point] = (uchar)found;
}
