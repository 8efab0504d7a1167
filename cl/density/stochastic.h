/* Look-ups of density, "stochastic": one sample instead of eight.

   The nearest sample to a position jittered by half a voxel, that is, a corner of the cell drawn with its
   trilinear weight: the expectation is the trilinear value, at an eighth of the loads.  Right wherever
   the density of one look-up is used once and linearly (METHODS §6); the bounds hold, as they hold for
   every sample of a cell.  A volume whose filter is `nearest` is not jittered. */
#ifndef CLVOL_DENSITY_STOCHASTIC_H
#define CLVOL_DENSITY_STOCHASTIC_H
#include "core/random.h"
#include "density/lanes.h"
#include "density/volume.h"

INLINE int drawn_corner(const VolumeCell *cell, bool nearest, Stream *stream)
{
    if (nearest)
        return cell_corner(cell, 0.5f, 0.5f, 0.5f);
    const uint2 k = stream_pair(stream); /* 21 bits an axis */
    const uint x = k.x >> 11, y = k.y >> 11, z = (k.x & 0x7FFu) << 10 | (k.y & 0x3FFu);
    const float unit = 0x1p-21f, half_unit = 0x1p-22f; /* never 0: a corner of weight 0 is not drawn */
    return cell_corner(cell, (float)x * unit + half_unit, (float)y * unit + half_unit, (float)z * unit + half_unit);
}

INLINE float density(const Scene *scene, __global const Volume *volume, float3 p, int channel, Stream *stream)
{
    const VolumeCell cell = volume_cell(scene, volume, p);
    const int corner = drawn_corner(&cell, volume_is_nearest(volume), stream);
    return cell.corner[corner + (cell.stride > 1 ? channel : 0)];
}

INLINE float3 density3(const Scene *scene, __global const Volume *volume, float3 p, Stream *stream)
{
    const VolumeCell cell = volume_cell(scene, volume, p);
    __global const float *value = cell.corner + drawn_corner(&cell, volume_is_nearest(volume), stream);
    return cell.stride > 1 ? (float3)(value[0], value[1], value[2]) : (float3)(value[0]);
}

#if CLVOL_LANES
INLINE Real lane_density(const LaneVolume *volume, Real x, Real y, Real z, Int channel, Int draws, LaneStream *stream)
{
    const LaneCell cell = lane_cell(volume, x, y, z, channel);
    const Real middle = (Real)(0.5f), unit = (Real)(0x1p-21f), half_unit = (Real)(0x1p-22f);
    if (volume->nearest)
        return lane_sample(volume, &cell, middle, middle, middle);
    const BitsPair k = lane_pair(stream, draws);
    const Int last = bits_int((k.x & 0x7FFu) << 10 | (k.y & 0x3FFu));
    return lane_sample(volume, &cell, to_real(bits_int(k.x >> 11)) * unit + half_unit,
                       to_real(bits_int(k.y >> 11)) * unit + half_unit, to_real(last) * unit + half_unit);
}
#endif

#endif
