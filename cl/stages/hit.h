/* The surface that a path has met. */
#ifndef CLVOL_STAGES_HIT_H
#define CLVOL_STAGES_HIT_H
#if CLVOL_HAS_SURFACES
#include "geometry/bvh.h"
#include "stages/path.h"

INLINE uint path_after_primitive_or_none(const Scene *scene, uint slot)
{
#if CLVOL_HAS_PASSABLE
    return path_after_primitive(scene, slot);
#else
    return NO_PRIMITIVE;
#endif
}

INLINE Hit path_hit(const Scene *scene, uint slot)
{
    Hit hit;
    hit.t = path_hit_t(scene, slot);
    hit.primitive = path_hit_primitive(scene, slot);
    hit.u = hit.v = 0.0f;
#if CLVOL_HAS_TRIANGLES
    hit.u = path_hit_u(scene, slot);
    hit.v = path_hit_v(scene, slot);
#endif
    return hit;
}

INLINE void set_path_hit(const Scene *scene, uint slot, const Hit *hit)
{
    set_path_hit_t(scene, slot, hit->primitive == NO_PRIMITIVE ? INFINITY : hit->t);
    set_path_hit_primitive(scene, slot, hit->primitive);
#if CLVOL_HAS_TRIANGLES
    set_path_hit_u(scene, slot, hit->u);
    set_path_hit_v(scene, slot, hit->v);
#endif
}

#endif
#endif
