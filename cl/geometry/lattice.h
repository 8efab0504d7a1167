/* A ray's walk through a uniform lattice, cell by cell (Amanatides and Woo 1987).  Each crossing is
   computed from its plane, not from the crossing before, and every step changes an integer index.
   The outermost cells reach out to infinity. */
#ifndef CLVOL_GEOMETRY_LATTICE_H
#define CLVOL_GEOMETRY_LATTICE_H
#include "core/types.h"

typedef struct {
    float t;           /* where the next plane is crossed */
    float offset;      /* that plane's coordinate, from the ray's origin */
    float offset_step; /* signed edge of a cell */
    float inverse_d;
    int left;   /* planes still ahead */
    int stride; /* signed step of the cell's number */
} LatticeAxis;

typedef struct {
    float t; /* the current cell's segment of the ray is [t, t_end] */
    float t_end;
    float t_max;
    LatticeAxis x, y, z;
    int cell; /* number of the current cell */
    int step; /* to add before the next segment */
} LatticeWalk;

/* Starts one axis; returns the number of the cell that holds o. */
INLINE int lattice_axis_begin(LatticeAxis *axis, float o, float d, int cells, float cell_size, int stride)
{
    const int cell = clamp_int(floor_int(o / cell_size), 0, cells - 1);
    const bool forward = d > 0.0f;
    axis->left = d == 0.0f ? 0 : (forward ? cells - 1 - cell : cell);
    axis->inverse_d = 1.0f / d;
    axis->offset = (float)(cell + (forward ? 1 : 0)) * cell_size - o;
    axis->offset_step = forward ? cell_size : -cell_size;
    axis->stride = forward ? stride : -stride;
    axis->t = axis->left > 0 ? axis->offset * axis->inverse_d : INFINITY;
    return cell;
}

/* Adding up `offset` does not drift: it grows from plane to plane, and edges are powers of two, so that a sum is
   exact unless it reaches the next binade.  All that is ever rounded is less than a unit in its last place. */
INLINE void lattice_axis_step(LatticeAxis *axis)
{
    axis->left -= 1;
    axis->offset += axis->offset_step;
    axis->t = axis->left > 0 ? axis->offset * axis->inverse_d : INFINITY;
}

INLINE LatticeWalk lattice_begin(Ray ray, int nx, int ny, int nz, float cell_size, float t_max)
{
    LatticeWalk walk;
    const int layer = nx * ny;
    walk.cell = lattice_axis_begin(&walk.x, ray.o.x, ray.d.x, nx, cell_size, 1);
    walk.cell += lattice_axis_begin(&walk.y, ray.o.y, ray.d.y, ny, cell_size, nx) * nx;
    walk.cell += lattice_axis_begin(&walk.z, ray.o.z, ray.d.z, nz, cell_size, layer) * layer;
    walk.step = 0;
    walk.t_end = 0.0f;
    walk.t_max = t_max;
    return walk;
}

/* Moves on to the next cell; false when t_max is reached. */
INLINE bool lattice_next(LatticeWalk *walk)
{
    walk->t = walk->t_end;
    if (!(walk->t < walk->t_max))
        return false;
    walk->cell += walk->step;
    float t_end;
    if (walk->x.t < walk->y.t && walk->x.t < walk->z.t) {
        t_end = walk->x.t;
        walk->step = walk->x.stride;
        lattice_axis_step(&walk->x);
    } else if (walk->y.t < walk->z.t) {
        t_end = walk->y.t;
        walk->step = walk->y.stride;
        lattice_axis_step(&walk->y);
    } else {
        t_end = walk->z.t;
        walk->step = walk->z.stride;
        lattice_axis_step(&walk->z);
    }
    walk->t_end = min_of(max_of(t_end, walk->t), walk->t_max);
    return true;
}

#endif
