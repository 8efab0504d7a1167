/* Isotropic scattering. */
#ifndef CLVOL_PHASE_ISOTROPIC_H
#define CLVOL_PHASE_ISOTROPIC_H
#include "core/sampling.h"
#include "core/shared.h"

INLINE float isotropic_pdf(__global const Phase *lobe, float3 wo, float3 wi) { return INV_FOUR_PI; }

INLINE float3 isotropic_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    *pdf = INV_FOUR_PI;
    return sphere_direction(u, v);
}

#endif
