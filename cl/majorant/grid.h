/* A uniform grid of bounds, walked cell by cell. */
#ifndef CLVOL_MAJORANT_GRID_H
#define CLVOL_MAJORANT_GRID_H
#include "geometry/lattice.h"
#include "tracking/interface.h"

typedef struct {
    LatticeWalk lattice;
    float t;
    float t_end;
    float majorant;
    int cell;
} MajorantWalk;

INLINE MajorantWalk majorant_begin(const MediumRay *in)
{
    MajorantWalk walk;
    __global const Medium *medium = in->medium;
    walk.lattice = lattice_begin(in->index_ray, medium->cells[0], medium->cells[1], medium->cells[2], medium->cell_size,
                                 in->t_max);
    return walk;
}

INLINE bool majorant_next(const MediumRay *in, MajorantWalk *walk)
{
    if (!lattice_next(&walk->lattice))
        return false;
    walk->t = walk->lattice.t;
    walk->t_end = walk->lattice.t_end;
    walk->cell = walk->lattice.cell;
    float bound = in->scene->majorants[in->medium->cell_offset + walk->cell];
#if CLVOL_HAS_LANES
    bound = max_of(bound, 0.0f); /* the mark of an empty block */
#endif
    walk->majorant = in->rate * bound;
    return true;
}

#endif
