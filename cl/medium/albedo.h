/* Single-scattering albedo of a medium. */
#ifndef CLVOL_MEDIUM_ALBEDO_H
#define CLVOL_MEDIUM_ALBEDO_H
#include "core/scene.h"
#if CLVOL_HAS_ALBEDO_VOLUME
#include "medium/spectrum.h"
#endif

/* At world point p. */
INLINE Spectrum medium_albedo(const Scene *scene, __global const Medium *medium, float3 p, int channel)
{
#if CLVOL_HAS_ALBEDO_VOLUME
    if (medium->albedo_volume >= 0) {
        __global const Volume *volume = scene->volumes + medium->albedo_volume;
        return medium_spectrum(scene, medium, TRANSFER_ALBEDO, volume, p, channel);
    }
#endif
    return to_spectrum(load_vector(medium->albedo), channel);
}

#endif
