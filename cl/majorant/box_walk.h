/* A walk through boxes of whole lattice cells, for bounds that are found from a root.  Each step moves one axis
   on, in the ray's direction, to the far plane of the box; none ever goes back, so that the walk ends. */
#ifndef CLVOL_MAJORANT_BOX_WALK_H
#define CLVOL_MAJORANT_BOX_WALK_H
#include "tracking/interface.h"

typedef struct {
    float t;
    float t_end;
    float majorant;
    int cell;
    float3 o; /* the ray, in units of lattice cells */
    float3 d;
    float3 inverse_d;
    int3 at; /* the lattice cell the next segment starts in */
} MajorantWalk;

INLINE MajorantWalk majorant_begin(const MediumRay *in)
{
    MajorantWalk walk;
    __global const Medium *medium = in->medium;
    const float scale = 1.0f / medium->cell_size;
    walk.o = in->index_ray.o * scale;
    walk.d = in->index_ray.d * scale;
    walk.inverse_d = 1.0f / walk.d; /* infinite for 0, and not used there */
    walk.at.x = clamp_int(floor_int(walk.o.x), 0, medium->cells[0] - 1);
    walk.at.y = clamp_int(floor_int(walk.o.y), 0, medium->cells[1] - 1);
    walk.at.z = clamp_int(floor_int(walk.o.z), 0, medium->cells[2] - 1);
    walk.t_end = 0.0f;
    return walk;
}

/* Where the ray leaves the slab [lower, upper) of one axis; the outermost cells have no outer plane. */
INLINE float box_exit(float o, float d, float inverse_d, int lower, int upper, int cells)
{
    if (d > 0.0f)
        return upper < cells ? ((float)upper - o) * inverse_d : INFINITY;
    if (d < 0.0f)
        return lower > 0 ? ((float)lower - o) * inverse_d : INFINITY;
    return INFINITY;
}

/* The cell of a point, not before `cell` along d, and within the box [lower, upper). */
INLINE int box_advance(int cell, float p, float d, int lower, int upper)
{
    const int found = clamp_int(floor_int(p), lower, upper - 1);
    return d > 0.0f ? max_int(found, cell) : min_int(found, cell);
}

/* Ends the segment that begins at walk->t in the box [lower, upper) of lattice cells, and moves on. */
INLINE void box_leave(const MediumRay *in, MajorantWalk *walk, int3 lower, int3 upper)
{
    __global const Medium *medium = in->medium;
    const float tx = box_exit(walk->o.x, walk->d.x, walk->inverse_d.x, lower.x, upper.x, medium->cells[0]);
    const float ty = box_exit(walk->o.y, walk->d.y, walk->inverse_d.y, lower.y, upper.y, medium->cells[1]);
    const float tz = box_exit(walk->o.z, walk->d.z, walk->inverse_d.z, lower.z, upper.z, medium->cells[2]);
    const float t_end = min_of(max_of(min_of(tx, min_of(ty, tz)), walk->t), in->t_max);
    const float3 p = walk->o + t_end * walk->d;
    int3 at;
    at.x = box_advance(walk->at.x, p.x, walk->d.x, lower.x, upper.x);
    at.y = box_advance(walk->at.y, p.y, walk->d.y, lower.y, upper.y);
    at.z = box_advance(walk->at.z, p.z, walk->d.z, lower.z, upper.z);
    if (tx <= ty && tx <= tz)
        at.x = walk->d.x > 0.0f ? upper.x : lower.x - 1;
    else if (ty <= tz)
        at.y = walk->d.y > 0.0f ? upper.y : lower.y - 1;
    else
        at.z = walk->d.z > 0.0f ? upper.z : lower.z - 1;
    walk->at = at; /* not used again once t_max is reached */
    walk->t_end = t_end;
}

#endif
