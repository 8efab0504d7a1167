/* Light that a medium emits whatever its extinction: its emission_density, radiance per length. */
#ifndef CLVOL_MEDIUM_GLOW_H
#define CLVOL_MEDIUM_GLOW_H
#if CLVOL_HAS_GLOW
#include "core/scene.h"
#if CLVOL_HAS_GLOW_VOLUME
#include "density/volume.h"
#endif

INLINE bool glows(const Scene *scene, int m)
{
    const float3 q = load_vector(scene->glows[m].emission_density);
    return max_of(q.x, max_of(q.y, q.z)) > 0.0f;
}

/* That of medium m at world point p. */
INLINE Spectrum glow_at(const Scene *scene, int m, float3 p, int channel)
{
    __global const Glow *glow = scene->glows + m;
    Spectrum q = to_spectrum(load_vector(glow->emission_density), channel); /* its scale included */
#if CLVOL_HAS_GLOW_VOLUME
    if (glow->volume >= 0) {
        __global const Volume *volume = scene->volumes + glow->volume;
        q *= volume_spectrum(scene, volume, transform_point(volume->world_to_index, p), channel);
    }
#endif
    return q;
}

#endif
#endif
