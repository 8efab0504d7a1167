/* What is forgotten when a ray, or a path, begins. */
#ifndef CLVOL_PATH_RESET_H
#define CLVOL_PATH_RESET_H
#include "core/scene.h"

/* A new ray has passed nothing yet. */
INLINE void reset_ray(const Scene *scene, uint slot)
{
    set_path_segment(scene, slot, 0);
    set_path_after_t(scene, slot, 0.0f);
    set_path_after_primitive(scene, slot, NO_PRIMITIVE);
}

/* A new path is inside of nothing until `intersect` finds otherwise. */
INLINE void reset_path(const Scene *scene, uint slot)
{
    reset_ray(scene, slot);
    Inside inside;
    for (int w = 0; w < CLVOL_BOUNDARY_WORDS; ++w)
        inside.word[w] = 0;
    set_path_inside(scene, slot, inside);
    set_path_eta_squared(scene, slot, 1.0f);
}

#endif
