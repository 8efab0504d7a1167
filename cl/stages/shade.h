/* Handles what happened to a path: it escaped to the environment, collided in a medium, or met a surface.  Each has
   a header of its own, which only scenes that need it compile.

   A path waits for its shadow ray before it goes on.  Walks and shadow rays that need another wave pass through here,
   since no stage may push to the queue that it reads. */
#ifndef CLVOL_STAGES_SHADE_H
#define CLVOL_STAGES_SHADE_H
#include "stages/collision_scatter.h"
#include "stages/escape.h"
#include "stages/path.h"
#include "stages/surface_scatter.h"

INLINE void shade(const Scene *scene, uint group, uint slot)
{
    const uint event = path_event(scene, slot);
    bool goes_on = false;
#if CLVOL_HAS_MEDIA
    if (event == EVENT_WALK) {
        set_path_event(scene, slot, path_reach(scene, slot) < INFINITY ? EVENT_SURFACE : EVENT_ESCAPE);
        queue_push(scene, group, QUEUE_MEDIUM, slot);
        return;
    }
#endif
#if CLVOL_NEE
    if (event == EVENT_SHADOW) {
        queue_push(scene, group, QUEUE_SHADOW, slot);
        return;
    }
#endif
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP
    if (event == EVENT_ESCAPE)
        shade_escape(scene, slot);
#endif
#if CLVOL_HAS_MEDIA
    if (event == EVENT_COLLISION)
        goes_on = shade_collision(scene, group, slot);
#endif
#if CLVOL_HAS_SURFACES
    if (event == EVENT_SURFACE)
        goes_on = shade_surface(scene, group, slot);
#endif
    uint next = goes_on ? QUEUE_INTERSECT : QUEUE_GENERATE;
#if CLVOL_NEE
    if (path_event(scene, slot) == EVENT_SHADOW) {
        set_path_next(scene, slot, next);
        next = QUEUE_SHADOW;
    }
#endif
    queue_push(scene, group, next, slot);
}

#endif
