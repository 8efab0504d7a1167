/* The one way to read a sampled field: brick map look-up at a point of index space.

   Bricks hold 8³ cells and therefore 9³ samples each, so that the eight corners of a cell always
   stand in one brick; the top grid maps a brick's place to its number: an array, or a tree where the volume
   is large and mostly empty.  Points beyond the lattice take the value at its border. */
#ifndef CLVOL_DENSITY_VOLUME_H
#define CLVOL_DENSITY_VOLUME_H
#include "core/scene.h"
#if CLVOL_HAS_TOP_TREES
#include "geometry/lattice_tree.h"
#endif

#define BRICK_SHIFT 3 /* cells are counted in BRICK_CELLS = 1 << BRICK_SHIFT */
#define BRICK_LAYER (BRICK_EDGE * BRICK_EDGE)

/* The interpolation cell that holds a point: its first corner's first channel, and the place inside. */
typedef struct {
    __global const float *corner;
    int stride; /* channels of a sample */
    float fx, fy, fz;
} VolumeCell;

/* Number of the brick at a place, in bricks. */
INLINE uint volume_brick(const Scene *scene, __global const Volume *volume, int x, int y, int z)
{
#if CLVOL_HAS_TOP_TREES
    int shift;
    if (volume->levels > 0)
        return (uint)tree_find(scene->tops + volume->top_offset, volume->levels, x, y, z, &shift);
#endif
    return (uint)scene->tops[volume->top_offset + (z * volume->bricks[1] + y) * volume->bricks[0] + x];
}

/* Number of the cell that holds a coordinate, along an axis of so many samples. */
INLINE int cell_place(float x, int size) { return min_int((int)clamp_to(x, 0.0f, (float)(size - 1)), size - 2); }

INLINE VolumeCell volume_cell(const Scene *scene, __global const Volume *volume, float3 p)
{
    const float x = clamp_to(p.x, 0.0f, (float)(volume->size[0] - 1));
    const float y = clamp_to(p.y, 0.0f, (float)(volume->size[1] - 1));
    const float z = clamp_to(p.z, 0.0f, (float)(volume->size[2] - 1));
    const int ix = min_int((int)x, volume->size[0] - 2);
    const int iy = min_int((int)y, volume->size[1] - 2);
    const int iz = min_int((int)z, volume->size[2] - 2);
    const uint brick = volume_brick(scene, volume, ix >> BRICK_SHIFT, iy >> BRICK_SHIFT, iz >> BRICK_SHIFT);
    const int in_brick = BRICK_CELLS - 1;
    VolumeCell cell;
    cell.stride = CLVOL_HAS_COLOURED_VOLUME ? volume->channels : 1;
    cell.corner = scene->bricks + (size_t)(volume->brick_offset + brick) * BRICK_SAMPLES +
                  ((iz & in_brick) * BRICK_LAYER + (iy & in_brick) * BRICK_EDGE + (ix & in_brick)) * cell.stride;
    cell.fx = x - (float)ix;
    cell.fy = y - (float)iy;
    cell.fz = z - (float)iz;
    return cell;
}

/* The corner that lies beyond the given fractions of the cell: (½, ½, ½) takes the nearest sample. */
INLINE int cell_corner(const VolumeCell *cell, float x, float y, float z)
{
    return ((cell->fx >= x ? 1 : 0) + (cell->fy >= y ? BRICK_EDGE : 0) + (cell->fz >= z ? BRICK_LAYER : 0)) *
           cell->stride;
}

INLINE float cell_trilinear(const VolumeCell *cell, int channel)
{
    const int s = cell->stride, y = BRICK_EDGE, z = BRICK_LAYER;
    __global const float *c = cell->corner + channel;
    const float c00 = lerp(c[0], c[s], cell->fx);
    const float c10 = lerp(c[y * s], c[(y + 1) * s], cell->fx);
    const float c01 = lerp(c[z * s], c[(z + 1) * s], cell->fx);
    const float c11 = lerp(c[(z + y) * s], c[(z + y + 1) * s], cell->fx);
    return lerp(lerp(c00, c10, cell->fy), lerp(c01, c11, cell->fy), cell->fz);
}

INLINE bool volume_is_nearest(__global const Volume *volume)
{
    return CLVOL_HAS_NEAREST && (!CLVOL_HAS_TRILINEAR || volume->nearest);
}

INLINE float cell_value(const VolumeCell *cell, bool nearest, int channel)
{
    if (nearest)
        return cell->corner[cell_corner(cell, 0.5f, 0.5f, 0.5f) + channel];
    return cell_trilinear(cell, channel);
}

/* Value of one channel of `volume` at index position p; a grey volume serves every channel. */
INLINE float volume_value(const Scene *scene, __global const Volume *volume, float3 p, int channel)
{
    const VolumeCell cell = volume_cell(scene, volume, p);
    return cell_value(&cell, volume_is_nearest(volume), cell.stride > 1 ? channel : 0);
}

/* All channels at once. */
INLINE float3 cell_value3(const VolumeCell *cell, bool nearest)
{
    const float first = cell_value(cell, nearest, 0);
    if (cell->stride == 1)
        return (float3)(first);
    return (float3)(first, cell_value(cell, nearest, 1), cell_value(cell, nearest, 2));
}

INLINE float3 volume_value3(const Scene *scene, __global const Volume *volume, float3 p)
{
    const VolumeCell cell = volume_cell(scene, volume, p);
    return cell_value3(&cell, volume_is_nearest(volume));
}

/* Value as a path carries it. */
INLINE Spectrum volume_spectrum(const Scene *scene, __global const Volume *volume, float3 p, int channel)
{
#if CLVOL_SPECTRUM == 3
    return volume_value3(scene, volume, p);
#else
    return volume_value(scene, volume, p, channel);
#endif
}

#endif
