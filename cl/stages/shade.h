/* Handles what happened to a path: it escaped to the environment, collided in a medium, or met a surface.  Each has
   a header of its own, which only scenes that need it compile.

   A path waits for its shadow ray before it goes on.  Walks and shadow rays that need another wave pass through here,
   since no stage may push to the queue that it empties. */
#ifndef CLVOL_STAGES_SHADE_H
#define CLVOL_STAGES_SHADE_H
#include "core/scene.h"
#include "path/draws.h"
#include "path/key.h"
#include "path/transitions.h"
#include "stages/collision_scatter.h"
#include "stages/escape.h"
#include "stages/surface_scatter.h"

#define DRAWS_DIRECTION (CLVOL_HAS_SCATTERING || CLVOL_HAS_REFLECTION)
#define DRAWS_LIGHT CLVOL_NEE

/* What will be drawn for a path that collided or met a surface; any other is handed on here. */
INLINE bool shade_begins(const Scene *scene, uint group, uint slot, Draws *draws)
{
    const uint event = path_event(scene, slot);
    if (CLVOL_HAS_MEDIA && event == EVENT_WALK) {
        to_medium(scene, group, slot, path_hit_t(scene, slot) < INFINITY ? EVENT_SURFACE : EVENT_ESCAPE);
        return false;
    }
    if (CLVOL_NEE && event == EVENT_SHADOW) {
        to_shadow(scene, group, slot, path_goes_on(scene, slot));
        return false;
    }
    if (event == EVENT_ESCAPE) {
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP || CLVOL_HAS_ALPHA || CLVOL_HAS_BACKDROP
        shade_escape(scene, slot);
#endif
        to_generate(scene, group, slot);
        return false;
    }
    draws->key = path_key(scene, slot);
    draws->block = BLOCK_SURFACE;
    draws->segment = path_segment(scene, slot);
#if CLVOL_HAS_MEDIA
    if (event == EVENT_COLLISION) {
        draws->block = BLOCK_WALK; /* as the walk that collided */
        draws->segment = draws->segment * scene->render->media + path_medium(scene, slot);
    }
#endif
    return true;
}

INLINE void shade(const Scene *scene, uint group, uint slot, const Draws *draws)
{
    bool goes_on = false, shadow_ray = false;
#if CLVOL_HAS_MEDIA
    if (draws->block == BLOCK_WALK)
        goes_on = shade_collision(scene, slot, draws, &shadow_ray);
#endif
#if CLVOL_HAS_SURFACES
    if (draws->block == BLOCK_SURFACE)
        goes_on = shade_surface(scene, slot, draws, &shadow_ray);
#endif
    if (CLVOL_NEE && shadow_ray)
        to_shadow(scene, group, slot, goes_on);
    else if (goes_on)
        to_intersect(scene, group, slot);
    else
        to_generate(scene, group, slot);
}

#endif
