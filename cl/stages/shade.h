/* Handles what happened to a path: it escaped to the environment, collided in a medium, or met a surface.  Each has
   a header of its own, which only scenes that need it compile. */
#ifndef CLVOL_STAGES_SHADE_H
#define CLVOL_STAGES_SHADE_H

INLINE void shade(const Scene *scene, uint group, uint slot)
{
    const uint event = path_event(scene, slot);
    bool goes_on = false;
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
    queue_push(scene, group, goes_on ? QUEUE_INTERSECT : QUEUE_GENERATE, slot);
}

#endif
