/* Light that a medium emits: its source term is sigma_a L_e. */
#ifndef CLVOL_MEDIUM_EMISSION_H
#define CLVOL_MEDIUM_EMISSION_H
#include "core/scene.h"
#if CLVOL_HAS_EMISSION_VOLUME || CLVOL_HAS_TEMPERATURE
#include "medium/spectrum.h"
#endif
#include "medium/albedo.h"

#if CLVOL_HAS_TEMPERATURE
/* Colour of a blackbody, of luminance 1: interpolated in a table over kelvin / (kelvin + BLACKBODY_MIDDLE). */
INLINE float3 blackbody(const Scene *scene, float kelvin)
{
    if (!(kelvin > 0.0f))
        return (float3)(0.0f);
    kelvin = min_of(kelvin, 1e30f); /* the quotient below must not be inf / inf */
    const float at = kelvin / (kelvin + BLACKBODY_MIDDLE) * (float)(BLACKBODY_BINS - 1);
    const int bin = min_int((int)at, BLACKBODY_BINS - 2);
    const float3 a = vload3(bin, scene->blackbody), b = vload3(bin + 1, scene->blackbody);
    return (b - a) * (at - (float)bin) + a;
}
#endif

/* L_e at world point p. */
INLINE Spectrum medium_radiance(const Scene *scene, __global const Medium *medium, float3 p, int channel)
{
    Spectrum radiance = to_spectrum(load_vector(medium->emission), channel); /* its scale included */
#if CLVOL_HAS_EMISSION_VOLUME
    if (medium->emission_volume >= 0) {
        __global const Volume *volume = scene->volumes + medium->emission_volume;
        radiance *= medium_spectrum(scene, medium, TRANSFER_EMISSION, volume, p, channel);
    }
#endif
#if CLVOL_HAS_TEMPERATURE
    if (medium->temperature_volume >= 0) {
        __global const Volume *volume = scene->volumes + medium->temperature_volume;
        const float value = volume_value(scene, volume, transform_point(volume->world_to_index, p), 0);
        const float kelvin = (value - medium->temperature_offset) * medium->temperature_scale;
        radiance *= to_spectrum(blackbody(scene, kelvin), channel);
    }
#endif
    return radiance;
}

/* What a unit of extinction emits at world point p: (sigma_a / sigma_t) L_e. */
INLINE Spectrum medium_source(const Scene *scene, __global const Medium *medium, float3 p, int channel)
{
    const Spectrum absorbed = 1.0f - medium_albedo(scene, medium, p, channel);
    if (!medium->emits || !(spectrum_max(absorbed) > 0.0f))
        return (Spectrum)(0.0f);
    return absorbed * medium_radiance(scene, medium, p, channel);
}

#endif
