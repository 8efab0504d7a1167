/* Handles what happened to a path: it escaped to the environment, collided in a medium, or met a surface.  Each has
   a header of its own, which only scenes that need it compile.

   A path waits for its shadow ray before it goes on.  Walks and shadow rays that need another wave pass through here,
   since no stage may push to the queue that it empties. */
#ifndef CLVOL_STAGES_SHADE_H
#define CLVOL_STAGES_SHADE_H
#include "core/scene.h"
#include "path/transitions.h"
#include "stages/collision_scatter.h"
#include "stages/escape.h"
#include "stages/surface_scatter.h"

INLINE void shade(const Scene *scene, uint group, uint slot)
{
    const uint event = path_event(scene, slot);
    if (CLVOL_HAS_MEDIA && event == EVENT_WALK) {
        to_medium(scene, group, slot, path_hit_t(scene, slot) < INFINITY ? EVENT_SURFACE : EVENT_ESCAPE);
        return;
    }
    if (CLVOL_NEE && event == EVENT_SHADOW) {
        to_shadow(scene, group, slot, path_goes_on(scene, slot));
        return;
    }
    bool goes_on = false, shadow_ray = false;
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
    if (event == EVENT_ESCAPE)
        shade_escape(scene, slot);
#endif
#if CLVOL_HAS_MEDIA
    if (event == EVENT_COLLISION)
        goes_on = shade_collision(scene, slot, &shadow_ray);
#endif
#if CLVOL_HAS_SURFACES
    if (event == EVENT_SURFACE)
        goes_on = shade_surface(scene, slot, &shadow_ray);
#endif
    if (CLVOL_NEE && shadow_ray)
        to_shadow(scene, group, slot, goes_on);
    else if (goes_on)
        to_intersect(scene, group, slot);
    else
        to_generate(scene, group, slot);
}

#endif
