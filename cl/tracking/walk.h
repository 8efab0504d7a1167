/* The walk that trackers share: from tentative collision to tentative collision, cell by cell.

   Between collisions only the optical depth still to go is kept, so that crossing a cell costs no
   random number.  Positions are measured from the cell's entry, to stay fine far along the ray. */
#ifndef CLVOL_TRACKING_WALK_H
#define CLVOL_TRACKING_WALK_H
#include "core/random.h"
#include "density/lookup.h"
#include "density/transfer.h"
#if CLVOL_HAS_VARIED_AREAS
#include "phase/sggx.h"
#endif
#include "tracking/interface.h"
#include "tracking/probability.h"
#include "tracking/record.h"

/* The segment of a ray inside one majorant cell, and where on it the walk stands. */
typedef struct {
    float3 start;
    float begin; /* ray parameter of the start */
    float length;
    float rate; /* of tentative collisions, per world length */
    float t;    /* from the start */
} Segment;

INLINE Segment segment_of(const MediumRay *in, float t, float t_end, float rate)
{
    Segment segment = {in->index_ray.o + t * in->index_ray.d, t, t_end - t, rate, 0.0f};
    return segment;
}

/* Moves on by the optical depth still to go, to the next tentative collision; false when the segment ends
   before, with the rest in `depth`. */
INLINE bool next_tentative(Segment *segment, float *depth, Tally *tally)
{
    const float left = (segment->length - segment->t) * segment->rate;
    if (*depth >= left) {
        *depth -= left;
        return false;
    }
    segment->t += *depth / segment->rate;
    tally->tentative += 1;
    RECORD_TENTATIVE(segment->begin + segment->t, segment->rate, tally);
    return true;
}

#if CLVOL_HAS_VARIED_AREAS
/* The area of microflakes across the ray at index position p, as a share of the most, which the scale has. */
INLINE float area_share(const MediumRay *in, float3 p)
{
    if (in->flakes < 0)
        return 1.0f;
    const float t = dot_of(p - in->index_ray.o, in->index_ray.d) / dot_of(in->index_ray.d, in->index_ray.d);
    float3 diagonal, rest;
    flake_matrix(in->scene, in->scene->volumes + in->flakes, in->flake_ray.o + t * in->flake_ray.d, &diagonal, &rest);
    return matrix_area(diagonal, rest, in->world_ray.d) / in->most_area;
}
#endif

/* sigma_t at index position p: one look-up. */
INLINE Extinction extinction_at(const MediumRay *in, float3 p, Stream *stream, Tally *tally)
{
    __global const Volume *volume = in->scene->volumes + in->medium->sigma_t_volume;
    tally->lookups += 1;
#if CLVOL_EXTINCTION == 3 && CLVOL_HAS_COLOURED_VOLUME
    const float3 made = density3_of(in->scene, in->medium, density3(in->scene, volume, p, stream));
#if CLVOL_HAS_VARIED_AREAS
    const Extinction sigma_t = in->scale * made * area_share(in, p);
#else
    const Extinction sigma_t = in->scale * made;
#endif
#else
    const float value = density(in->scene, volume, p, in->channel, stream);
#if CLVOL_HAS_VARIED_AREAS
    const Extinction sigma_t = in->scale * (density_of(in->scene, in->medium, value) * area_share(in, p));
#else
    const Extinction sigma_t = in->scale * density_of(in->scene, in->medium, value);
#endif
#endif
    RECORD_LOOKUP(in, p, sigma_t, tally);
    return sigma_t;
}

/* sigma_t where the segment, or the flight, stands. */
INLINE Extinction segment_extinction(const MediumRay *in, const Segment *at, Stream *stream, Tally *tally)
{
    return extinction_at(in, at->start + at->t * in->index_ray.d, stream, tally);
}

INLINE float segment_t(const Segment *at) { return at->begin + at->t; }

/* A row of a table of coefficients per cell, `extra` numbers after its channels. */
INLINE __global const float *cell_row(const MediumRay *in, __global const float *table, int cell, int extra)
{
    return table + (in->medium->cell_offset + cell) * (CLVOL_DENSITY_CHANNELS + extra);
}

/* The coefficient in such a row. */
INLINE Extinction cell_extinction(const MediumRay *in, __global const float *row)
{
#if CLVOL_HAS_VARIED_AREAS
    const float least = least_share(in->scene, in->medium);
#if CLVOL_DENSITY_CHANNELS == 1
    return in->scale * (least * row[0]);
#elif CLVOL_EXTINCTION == 3
    return in->scale * least * load_vector(row);
#else
    return in->scale * (least * row[in->channel]);
#endif
#elif CLVOL_DENSITY_CHANNELS == 1
    return in->scale * row[0];
#elif CLVOL_EXTINCTION == 3
    return in->scale * load_vector(row);
#else
    return in->scale * row[in->channel];
#endif
}

/* How likely, but for a factor, an event of coefficient `sigma` is to be chosen by a path of weight beta. */
INLINE float event_rate(Spectrum beta, Extinction sigma)
{
#if CLVOL_EXTINCTION == 3
    return spectral_rate(beta, sigma);
#else
    return abs_of(sigma);
#endif
}

#endif
