/* A uniform grid of bounds, walked cell by cell (Amanatides and Woo 1987).  Each crossing
   is computed from its plane, not from the crossing before, and every step changes an integer index. */
#ifndef CLVOL_MAJORANT_H
#define CLVOL_MAJORANT_H

typedef struct {
    float t;           /* where the next plane is crossed */
    float offset;      /* that plane's coordinate, from the ray's origin */
    float offset_step; /* signed edge of a cell */
    float inverse_d;
    int left;   /* planes still ahead */
    int stride; /* signed step in `majorants` */
} GridAxis;

typedef struct {
    float t;
    float t_end;
    float majorant;
    float t_max;
    GridAxis x, y, z;
    int cell; /* current entry of `majorants` */
    int step; /* stride to take before the next segment */
} MajorantWalk;

/* Starts one axis; returns the number of the cell that holds o. */
INLINE int grid_axis_begin(GridAxis *axis, float o, float d, int cells, float cell_size, int stride)
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

INLINE void grid_axis_step(GridAxis *axis)
{
    axis->left -= 1;
    axis->offset += axis->offset_step;
    axis->t = axis->left > 0 ? axis->offset * axis->inverse_d : INFINITY;
}

INLINE MajorantWalk majorant_begin(const Scene *scene, __global const Medium *medium, Ray ray, float t_max)
{
    MajorantWalk walk;
    const int row = medium->cells[0], layer = row * medium->cells[1];
    const float size = medium->cell_size;
    walk.cell = medium->cell_offset;
    walk.cell += grid_axis_begin(&walk.x, ray.o.x, ray.d.x, medium->cells[0], size, 1);
    walk.cell += grid_axis_begin(&walk.y, ray.o.y, ray.d.y, medium->cells[1], size, row) * row;
    walk.cell += grid_axis_begin(&walk.z, ray.o.z, ray.d.z, medium->cells[2], size, layer) * layer;
    walk.step = 0;
    walk.t_end = 0.0f;
    walk.t_max = t_max;
    return walk;
}

INLINE bool majorant_next(const Scene *scene, __global const Medium *medium, MajorantWalk *walk)
{
    walk->t = walk->t_end;
    if (!(walk->t < walk->t_max))
        return false;
    walk->cell += walk->step;
    walk->majorant = scene->majorants[walk->cell];
    float t_end;
    if (walk->x.t < walk->y.t && walk->x.t < walk->z.t) {
        t_end = walk->x.t;
        walk->step = walk->x.stride;
        grid_axis_step(&walk->x);
    } else if (walk->y.t < walk->z.t) {
        t_end = walk->y.t;
        walk->step = walk->y.stride;
        grid_axis_step(&walk->y);
    } else {
        t_end = walk->z.t;
        walk->step = walk->z.stride;
        grid_axis_step(&walk->z);
    }
    walk->t_end = min_of(max_of(t_end, walk->t), walk->t_max);
    return true;
}

#endif
