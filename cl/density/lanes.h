/* Look-ups of density in lanes: what cl/density/volume.h computes, of one volume whose top grid is an array. */
#ifndef CLVOL_DENSITY_LANES_H
#define CLVOL_DENSITY_LANES_H
#if CLVOL_LANES
#include "core/lane_random.h"
#include "density/volume.h"

/* The volume that all lanes look up, in registers. */
typedef struct {
    __global const float *bricks;
    __global const int *tops;
    int last[3]; /* sample of an axis */
    int across;  /* bricks of a row */
    int layer;   /* and of a layer */
    int stride;  /* channels of a sample */
    bool nearest;
} LaneVolume;

INLINE LaneVolume lane_volume(const Scene *scene, __global const Volume *volume)
{
    LaneVolume lanes;
    lanes.bricks = scene->bricks + (size_t)volume->brick_offset * BRICK_SAMPLES;
    lanes.tops = scene->tops + volume->top_offset;
    for (int axis = 0; axis < 3; ++axis)
        lanes.last[axis] = volume->size[axis] - 1;
    lanes.across = volume->bricks[0];
    lanes.layer = volume->bricks[0] * volume->bricks[1];
    lanes.stride = CLVOL_HAS_COLOURED_VOLUME ? volume->channels : 1;
    lanes.nearest = volume_is_nearest(volume);
    return lanes;
}

/* The interpolation cells of the lanes' points: first corners, as indices into the bricks, and the places inside. */
typedef struct {
    Int corner;
    Real fx, fy, fz;
} LaneCell;

INLINE Int lane_axis_cell(Real p, int last, Real *fraction)
{
    const Real x = least_of(greatest_of(p, (Real)(0.0f)), (Real)((float)last));
    const Int cell = least_int(to_int(x), (Int)(last - 1));
    *fraction = x - to_real(cell);
    return cell;
}

INLINE LaneCell lane_cell(const LaneVolume *volume, Real x, Real y, Real z, Int channel)
{
    LaneCell cell;
    const Int ix = lane_axis_cell(x, volume->last[0], &cell.fx);
    const Int iy = lane_axis_cell(y, volume->last[1], &cell.fy);
    const Int iz = lane_axis_cell(z, volume->last[2], &cell.fz);
    const Int top = (iz >> BRICK_SHIFT) * volume->layer + (iy >> BRICK_SHIFT) * volume->across + (ix >> BRICK_SHIFT);
    const Int brick = gather_int(volume->tops, top);
    const int in_brick = BRICK_CELLS - 1;
    const Int inside = (iz & in_brick) * BRICK_LAYER + (iy & in_brick) * BRICK_EDGE + (ix & in_brick);
    cell.corner = brick * BRICK_SAMPLES + inside * volume->stride;
#if CLVOL_HAS_COLOURED_VOLUME
    cell.corner += volume->stride > 1 ? channel : (Int)(0);
#endif
    return cell;
}

/* The samples at the corners that lie beyond the given fractions of the cells, as cell_corner has it. */
INLINE Real lane_sample(const LaneVolume *volume, const LaneCell *cell, Real x, Real y, Real z)
{
    const Int offset = (MASK(cell->fx >= x) & 1) + (MASK(cell->fy >= y) & BRICK_EDGE) +
                       (MASK(cell->fz >= z) & BRICK_LAYER);
    return gather_real(volume->bricks, cell->corner + offset * volume->stride);
}

INLINE Real lane_trilinear(const LaneVolume *volume, const LaneCell *cell)
{
    const int s = volume->stride, y = BRICK_EDGE * s, z = BRICK_LAYER * s;
    __global const float *c = volume->bricks;
    const Int at = cell->corner;
    const Real c00 = between(gather_real(c, at), gather_real(c + s, at), cell->fx);
    const Real c10 = between(gather_real(c + y, at), gather_real(c + (y + s), at), cell->fx);
    const Real c01 = between(gather_real(c + z, at), gather_real(c + (z + s), at), cell->fx);
    const Real c11 = between(gather_real(c + (z + y), at), gather_real(c + (z + y + s), at), cell->fx);
    return between(between(c00, c10, cell->fy), between(c01, c11, cell->fy), cell->fz);
}

#endif

#endif
