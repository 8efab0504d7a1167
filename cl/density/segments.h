/* A ray through a sampled density, segment by segment: between the planes of the samples (of the cells half-way
   between them, for a nearest filter) the density is a polynomial of the ray parameter, of degree 3
   for a trilinear filter, so that two Gauss-Legendre points integrate it exactly (METHODS §3, regular).  With a
   transfer function it is one for a nearest filter alone. */
#ifndef CLVOL_DENSITY_SEGMENTS_H
#define CLVOL_DENSITY_SEGMENTS_H
#include "density/transfer.h"
#include "density/volume.h"
#include "tracking/walk.h"

/* The walk through the segments of a stretch of the ray.  Each axis is mirrored where the direction is negative, so
   that planes are crossed in the order of their numbers.  No step branches on the axis that it crosses, which no
   processor can predict, and none waits for what the one before looked up. */
typedef struct {
    float3 start; /* of the stretch, mirrored, in units in which planes are integers */
    float3 inverse_d;
    float3 plane; /* next on each axis */
    float3 last;  /* the clamped borders beyond are segments of their own */
    float3 reach; /* where the planes are crossed */
    float t;      /* the current segment is [t, t_end], from the start of the stretch */
    float t_end;
    float length;
} SegmentWalk;

INLINE void segments_reach(SegmentWalk *walk)
{
    walk->reach = walk->plane <= walk->last ? (walk->plane - walk->start) * walk->inverse_d : (float3)(INFINITY);
}

/* Starts the segments of the ray from t on; their parameters count from there. */
INLINE SegmentWalk segments_begin(const MediumRay *in, float t, float t_end)
{
    __global const Volume *volume = in->scene->volumes + in->medium->sigma_t_volume;
    const bool nearest = volume_is_nearest(volume);
    const float less = nearest ? 1.0f : 0.0f;
    const float3 d = in->index_ray.d, p = in->index_ray.o + t * d + (nearest ? -0.5f : 0.0f);
    const float3 size = (float3)((float)volume->size[0], (float)volume->size[1], (float)volume->size[2]);
    const float3 most = size - 1.0f - less;
    SegmentWalk walk;
    walk.start = d < 0.0f ? -p : p;
    walk.inverse_d = 1.0f / (float3)(abs_of(d.x), abs_of(d.y), abs_of(d.z)); /* of -0, too, infinite and positive */
    walk.last = d < 0.0f ? (float3)(0.0f) : most;
    const float3 first = d < 0.0f ? -most : (float3)(0.0f);
    walk.plane.x = max_of((float)floor_int(walk.start.x) + 1.0f, first.x);
    walk.plane.y = max_of((float)floor_int(walk.start.y) + 1.0f, first.y);
    walk.plane.z = max_of((float)floor_int(walk.start.z) + 1.0f, first.z);
    walk.t_end = 0.0f;
    walk.length = t_end - t;
    segments_reach(&walk);
    return walk;
}

/* Moves on to the next segment; false at the end of the stretch. */
INLINE bool segments_next(SegmentWalk *walk)
{
    walk->t = walk->t_end;
    const float3 reach = walk->reach;
    const float next = min_of(reach.x, min_of(reach.y, reach.z));
    walk->plane += reach <= next ? (float3)(1.0f) : (float3)(0.0f);
    segments_reach(walk);
    walk->t_end = min_of(next, walk->length);
    return walk->t < walk->length;
}

/* The one interpolation cell that a segment lies in: its samples are found once for all points of the segment. */
typedef struct {
    VolumeCell cell;
    float3 middle; /* of the segment, from the cell's first corner; outside of it where borders are clamped */
    float half_length;
    bool nearest;
} SegmentCell;

/* sigma_t at a point of the segment, `offset` from its middle. */
INLINE Extinction segment_value(const MediumRay *in, const SegmentCell *at, float offset)
{
    VolumeCell cell = at->cell;
    const float3 place = at->middle + offset * in->index_ray.d;
    cell.fx = clamp_to(place.x, 0.0f, 1.0f);
    cell.fy = clamp_to(place.y, 0.0f, 1.0f);
    cell.fz = clamp_to(place.z, 0.0f, 1.0f);
#if CLVOL_EXTINCTION == 3 && CLVOL_HAS_COLOURED_VOLUME
    return in->scale * density3_of(in->scene, in->medium, cell_value3(&cell, at->nearest));
#else
    const float value = cell_value(&cell, at->nearest, cell.stride > 1 ? in->channel : 0);
    return in->scale * density_of(in->scene, in->medium, value);
#endif
}

/* start: of the walk, in index space. */
INLINE SegmentCell segment_cell(const MediumRay *in, float3 start, float t, float t_end, Tally *tally)
{
    __global const Volume *volume = in->scene->volumes + in->medium->sigma_t_volume;
    const float3 p = start + 0.5f * (t_end + t) * in->index_ray.d;
    SegmentCell at;
    at.cell = volume_cell(in->scene, volume, p);
    at.middle = p - (float3)((float)cell_place(p.x, volume->size[0]), (float)cell_place(p.y, volume->size[1]),
                             (float)cell_place(p.z, volume->size[2]));
    at.half_length = 0.5f * (t_end - t);
    at.nearest = volume_is_nearest(volume);
    tally->lookups += 1;
    RECORD_LOOKUP(in, p, segment_value(in, &at, 0.0f), tally);
    return at;
}

/* Optical depth of a segment. */
INLINE Extinction segment_depth(const MediumRay *in, const SegmentCell *at)
{
    const float offset = at->half_length * 0.57735026919f;
    return at->half_length * (segment_value(in, at, -offset) + segment_value(in, at, offset));
}

/* sigma_t = a + b w + c w² + d w³ over a segment, w from 0 at its start to 8 at its end. */
typedef struct {
    Extinction a, b, c, d;
} Cubic;

INLINE Cubic segment_cubic(const MediumRay *in, const SegmentCell *at)
{
    const float unit = 0.25f * at->half_length;
    const Extinction f1 = segment_value(in, at, -3.0f * unit), f3 = segment_value(in, at, -unit);
    const Extinction f5 = segment_value(in, at, unit), f7 = segment_value(in, at, 3.0f * unit);
    /* through the four values, about the middle w = 4, then moved to the start */
    const Extinction inner = 0.5f * (f5 - f3), outer = 0.5f * (f7 - f1);
    const Extinction d = (outer - 3.0f * inner) * (1.0f / 24.0f), b = inner - d;
    const Extinction c = ((f1 + f7) - (f3 + f5)) * 0.0625f, a = (9.0f * (f3 + f5) - (f1 + f7)) * 0.0625f;
    Cubic cubic = {a - 4.0f * b + 16.0f * c - 64.0f * d, b - 8.0f * c + 48.0f * d, c - 12.0f * d, d};
    return cubic;
}

INLINE Extinction cubic_value(const Cubic *f, float w) { return f->a + w * (f->b + w * (f->c + w * f->d)); }

/* Integral from 0 to w. */
INLINE Extinction cubic_integral(const Cubic *f, float w)
{
    return w * (f->a + w * (0.5f * f->b + w * ((1.0f / 3.0f) * f->c + 0.25f * w * f->d)));
}

#endif
