/* An adaptive tree of bounds (after Yue et al. 2010), walked leaf by leaf from the root.

   A node is two 32-bit words.  Inner: x = plane << 2 | axis, y = its left child (the right one
   follows it).  Leaf: the low bits of x are 3; x read as a float is the maximum (setting the two low
   bits of a non-negative float rounds it up, so it stays a bound; 3 alone stands for an exact 0),
   y is the leaf's row in the tables of controls.  Planes are numbers of the finest majorant cells, so
   that the walk steps through integers. */
#ifndef CLVOL_MAJORANT_KDTREE_H
#define CLVOL_MAJORANT_KDTREE_H
#include "majorant/box_walk.h"

INLINE bool majorant_next(const MediumRay *in, MajorantWalk *walk)
{
    __global const Medium *medium = in->medium;
    __global const uint2 *nodes = in->scene->kd_nodes + medium->kd_root;
    walk->t = walk->t_end;
    if (!(walk->t < in->t_max))
        return false;
    int3 lower = (int3)(0, 0, 0), upper = (int3)(medium->cells[0], medium->cells[1], medium->cells[2]);
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
    box_leave(in, walk, lower, upper);
    return true;
}

#endif
