/* Look-ups of density, "exact": the volume's own filter.

   Each header that a look-up names implements

       float density(scene, volume, p, channel, stream);
       float3 density3(scene, volume, p, stream);        three channels, for trackers that follow them all

   whose expectation is the field at index position p. */
#ifndef CLVOL_DENSITY_LOOKUP_H
#define CLVOL_DENSITY_LOOKUP_H
#include "density/volume.h"

INLINE float density(const Scene *scene, __global const Volume *volume, float3 p, int channel, Stream *stream)
{
    return volume_value(scene, volume, p, channel);
}

INLINE float3 density3(const Scene *scene, __global const Volume *volume, float3 p, Stream *stream)
{
    return volume_value3(scene, volume, p);
}

#endif
