/* What a volume of a medium has at a world point: its albedo or its emission. */
#ifndef CLVOL_MEDIUM_SPECTRUM_H
#define CLVOL_MEDIUM_SPECTRUM_H
#include "density/transfer.h"
#include "density/volume.h"

INLINE Spectrum medium_spectrum(const Scene *scene, __global const Medium *medium, int role,
                                __global const Volume *volume, float3 p, int channel)
{
    const float3 place = transform_point(volume->world_to_index, p);
#if CLVOL_HAS_TRANSFER
    if (is_classified(scene, medium, role))
        return to_spectrum(classified_colour(scene, medium, role, volume_value(scene, volume, place, 0)), channel);
#endif
    return volume_spectrum(scene, volume, place, channel);
}

#endif
