/* A grid of bounds over a lattice that is mostly constant: cells of one size where something changes, and
   larger ones, each of one entry of the tree that all are found through, and crossed in one step, elsewhere. */
#ifndef CLVOL_MAJORANT_TREE_GRID_H
#define CLVOL_MAJORANT_TREE_GRID_H
#include "geometry/lattice_tree.h"
#include "majorant/box_walk.h"

INLINE bool majorant_next(const MediumRay *in, MajorantWalk *walk)
{
    __global const Medium *medium = in->medium;
    walk->t = walk->t_end;
    if (!(walk->t < in->t_max))
        return false;
    int shift;
    __global const int *links = in->scene->majorant_links + medium->links_first;
    walk->cell = tree_find(links, medium->links_levels, walk->at.x, walk->at.y, walk->at.z, &shift);
    walk->majorant = in->rate * in->scene->majorants[medium->cell_offset + walk->cell];
    const int3 lower = (int3)(walk->at.x >> shift << shift, walk->at.y >> shift << shift, walk->at.z >> shift << shift);
    int3 upper; /* the lattice may end inside an entry */
    upper.x = min_int(lower.x + (1 << shift), medium->cells[0]);
    upper.y = min_int(lower.y + (1 << shift), medium->cells[1]);
    upper.z = min_int(lower.z + (1 << shift), medium->cells[2]);
    box_leave(in, walk, lower, upper);
    return true;
}

#endif
