/* A ray through a sampled density, segment by segment: between the planes of the samples (of the cells half-way
   between them, for a nearest filter) the density is a polynomial of the ray parameter, of degree 3
   for a trilinear filter, so that two Gauss-Legendre points integrate it exactly (METHODS §3, regular). */
#ifndef CLVOL_DENSITY_SEGMENTS_H
#define CLVOL_DENSITY_SEGMENTS_H
#include "density/volume.h"
#include "geometry/lattice.h"
#include "tracking/walk.h"

/* Starts the segments of [t, t_end] of the ray; their parameters count from t. */
INLINE LatticeWalk segments_begin(const MediumRay *in, float t, float t_end)
{
    __global const Volume *volume = in->scene->volumes + in->medium->sigma_t_volume;
    const bool nearest = volume_is_nearest(volume);
    const int more = nearest ? 0 : 1; /* the clamped borders are segments of their own */
    Ray ray = in->index_ray;
    ray.o += t * ray.d + (nearest ? 0.5f : 1.0f);
    return lattice_begin(ray, volume->size[0] + more, volume->size[1] + more, volume->size[2] + more, 1.0f, t_end - t);
}

/* Optical depth of a segment. */
INLINE Extinction segment_depth(const MediumRay *in, float3 start, const LatticeWalk *segment, Stream *stream,
                                Tally *tally)
{
    const float half_length = 0.5f * (segment->t_end - segment->t), middle = 0.5f * (segment->t_end + segment->t);
    const float offset = half_length * 0.57735026919f;
    const Extinction a = extinction_at(in, start + (middle - offset) * in->index_ray.d, stream, tally);
    const Extinction b = extinction_at(in, start + (middle + offset) * in->index_ray.d, stream, tally);
    return half_length * (a + b);
}

/* sigma_t = a + b w + c w² + d w³ over a segment, w from 0 at its start to 8 at its end. */
typedef struct {
    Extinction a, b, c, d;
} Cubic;

INLINE Cubic segment_cubic(const MediumRay *in, float3 start, const LatticeWalk *segment, Stream *stream, Tally *tally)
{
    const float unit = 0.125f * (segment->t_end - segment->t);
    const Extinction f1 = extinction_at(in, start + (segment->t + unit) * in->index_ray.d, stream, tally);
    const Extinction f3 = extinction_at(in, start + (segment->t + 3.0f * unit) * in->index_ray.d, stream, tally);
    const Extinction f5 = extinction_at(in, start + (segment->t + 5.0f * unit) * in->index_ray.d, stream, tally);
    const Extinction f7 = extinction_at(in, start + (segment->t + 7.0f * unit) * in->index_ray.d, stream, tally);
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
