/* Majorant cells of walks in lanes: where each is, and how far it holds, follow from a position alone.

   The cell is that of a position nudged ahead on every axis, by less than the slack that bounds have beyond their
   cells (clvol/accel/bounds.py): a walk that stands on a plane finds the cell behind it whatever was rounded, and
   no look-up loses its bound.  The way is never nudged, since a ray along a plane would then not get on. */
#ifndef CLVOL_MAJORANT_LANES_H
#define CLVOL_MAJORANT_LANES_H
#if CLVOL_LANES
#include "core/lanes.h"
#include "core/scene.h"

#define LANE_NUDGE 0x1p-11f /* of a voxel */

/* Directions from which an axis is never left: no plane is met, and none of its products is infinite. */
#define LEAST_DIRECTION 1e-20f

/* The cells that all lanes walk. */
typedef struct {
    __global const float *majorants;
    int cells[3];
    float cell_size;
    float scale; /* 1 / cell_size */
    float bound; /* of all cells */
} LaneCells;

INLINE LaneCells lane_cells(const Scene *scene, __global const Medium *medium)
{
    LaneCells lanes;
#if CLVOL_WALKS_GRID
    lanes.majorants = scene->majorants + medium->cell_offset;
#endif
    for (int axis = 0; axis < 3; ++axis)
        lanes.cells[axis] = medium->cells[axis];
    lanes.cell_size = medium->cell_size;
    lanes.scale = 1.0f / medium->cell_size;
    lanes.bound = medium->majorant;
    return lanes;
}

/* The cell of a position on one axis. */
INLINE Int lane_axis_cell_of(const LaneCells *lanes, int cells, Real o, Real d, Real t)
{
    const Int forward = MASK(d > 0.0f);
    const Real p = (o + t * d + either(forward, (Real)(LANE_NUDGE), (Real)(-LANE_NUDGE))) * lanes->scale;
    return to_int(least_of(greatest_of(p, (Real)(0.0f)), (Real)((float)(cells - 1))));
}

/* Where the ray leaves, on one axis, the aligned block of `edge` cells that holds a cell; the outermost have no outer
   plane. */
INLINE Real lane_axis_exit(const LaneCells *lanes, int cells, Real o, Real d, Real inverse_d, Int cell, Int edge)
{
    const Int forward = MASK(d > 0.0f);
    const Int plane = least_int((cell & -edge) + (forward & edge), (Int)(cells));
    const Int outer = MASK(plane == (forward & cells));
    return either(outer, (Real)(INFINITY), (to_real(plane) * lanes->cell_size - o) * inverse_d);
}

#endif

#endif
