/* Look-ups of density, "exact": the volume's own filter. */
#ifndef CLVOL_DENSITY_EXACT_H
#define CLVOL_DENSITY_EXACT_H
#include "core/random.h"
#include "density/lanes.h"
#include "density/volume.h"

INLINE float density(const Scene *scene, __global const Volume *volume, float3 p, int channel, Stream *stream)
{
    return volume_value(scene, volume, p, channel);
}

INLINE float3 density3(const Scene *scene, __global const Volume *volume, float3 p, Stream *stream)
{
    return volume_value3(scene, volume, p);
}

#if CLVOL_LANES
INLINE Real lane_density(const LaneVolume *volume, Real x, Real y, Real z, Int channel, Int draws, LaneStream *stream)
{
    const LaneCell cell = lane_cell(volume, x, y, z, channel);
    const Real middle = (Real)(0.5f);
    return volume->nearest ? lane_sample(volume, &cell, middle, middle, middle) : lane_trilinear(volume, &cell);
}
#endif

#endif
