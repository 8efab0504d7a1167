/* An adaptive tree of bounds (after Yue et al. 2010), walked leaf by leaf from the root.

   A node is two 32-bit words.  Inner: x = plane << 2 | axis, y = its left child (the right one
   follows it).  Leaf: the low bits of x are 3; x read as a float is the maximum (setting the two low
   bits of a non-negative float rounds it up, so it stays a bound; 3 alone stands for an exact 0),
   y is the leaf's row in the tables of controls.  Planes are numbers of the finest majorant cells, so
   that the walk steps through integers: each step moves one axis on, in the ray's direction, and none
   ever goes back. */
#ifndef CLVOL_MAJORANT_H
#define CLVOL_MAJORANT_H
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
    walk.o = in->ray.o * scale;
    walk.d = in->ray.d * scale;
    walk.inverse_d = 1.0f / walk.d; /* infinite for 0, and not used there */
    walk.at.x = clamp_int(floor_int(walk.o.x), 0, medium->cells[0] - 1);
    walk.at.y = clamp_int(floor_int(walk.o.y), 0, medium->cells[1] - 1);
    walk.at.z = clamp_int(floor_int(walk.o.z), 0, medium->cells[2] - 1);
    walk.t_end = 0.0f;
    return walk;
}

/* Where the ray leaves the slab [lower, upper) of one axis; the outermost cells have no outer plane. */
INLINE float kdtree_exit(float o, float d, float inverse_d, int lower, int upper, int cells)
{
    if (d > 0.0f)
        return upper < cells ? ((float)upper - o) * inverse_d : INFINITY;
    if (d < 0.0f)
        return lower > 0 ? ((float)lower - o) * inverse_d : INFINITY;
    return INFINITY;
}

/* The cell of a point, not before `cell` along d, and within the leaf [lower, upper). */
INLINE int kdtree_advance(int cell, float p, float d, int lower, int upper)
{
    const int found = clamp_int(floor_int(p), lower, upper - 1);
    return d > 0.0f ? max_int(found, cell) : min_int(found, cell);
}

INLINE bool majorant_next(const MediumRay *in, MajorantWalk *walk)
{
    __global const Medium *medium = in->medium;
    __global const uint2 *nodes = in->scene->kd_nodes + medium->kd_root;
    walk->t = walk->t_end;
    if (!(walk->t < in->t_max))
        return false;
    const int cx = medium->cells[0], cy = medium->cells[1], cz = medium->cells[2];
    int3 lower = (int3)(0, 0, 0), upper = (int3)(cx, cy, cz);
    uint2 node = nodes[0];
    while ((node.x & 3u) != 3u) {
        const int plane = (int)(node.x >> 2);
        uint child = node.y;
        if ((node.x & 3u) == 0u) {
            const bool right = walk->at.x >= plane;
            lower.x = right ? plane : lower.x, upper.x = right ? upper.x : plane, child += right;
        } else if ((node.x & 3u) == 1u) {
            const bool right = walk->at.y >= plane;
            lower.y = right ? plane : lower.y, upper.y = right ? upper.y : plane, child += right;
        } else {
            const bool right = walk->at.z >= plane;
            lower.z = right ? plane : lower.z, upper.z = right ? upper.z : plane, child += right;
        }
        node = nodes[child];
    }
    walk->majorant = node.x == 3u ? 0.0f : in->rate * as_float(node.x);
    walk->cell = (int)node.y;
    const float tx = kdtree_exit(walk->o.x, walk->d.x, walk->inverse_d.x, lower.x, upper.x, cx);
    const float ty = kdtree_exit(walk->o.y, walk->d.y, walk->inverse_d.y, lower.y, upper.y, cy);
    const float tz = kdtree_exit(walk->o.z, walk->d.z, walk->inverse_d.z, lower.z, upper.z, cz);
    const float t_end = min_of(max_of(min_of(tx, min_of(ty, tz)), walk->t), in->t_max);
    const float3 p = walk->o + t_end * walk->d;
    int3 at;
    at.x = kdtree_advance(walk->at.x, p.x, walk->d.x, lower.x, upper.x);
    at.y = kdtree_advance(walk->at.y, p.y, walk->d.y, lower.y, upper.y);
    at.z = kdtree_advance(walk->at.z, p.z, walk->d.z, lower.z, upper.z);
    if (tx <= ty && tx <= tz)
        at.x = walk->d.x > 0.0f ? upper.x : lower.x - 1;
    else if (ty <= tz)
        at.y = walk->d.y > 0.0f ? upper.y : lower.y - 1;
    else
        at.z = walk->d.z > 0.0f ? upper.z : lower.z - 1;
    walk->at = at; /* not used again once t_max is reached */
    walk->t_end = t_end;
    return true;
}

#endif
