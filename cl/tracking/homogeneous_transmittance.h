/* Transmittance of a homogeneous medium: the closed form. */
#ifndef CLVOL_TRACKING_HOMOGENEOUS_TRANSMITTANCE_H
#define CLVOL_TRACKING_HOMOGENEOUS_TRANSMITTANCE_H
#if CLVOL_HAS_HOMOGENEOUS
#include "tracking/channels.h"
#include "tracking/interface.h"

INLINE Extinction homogeneous_transmittance(const MediumRay *in) { return exp_of_minus(in->scale * in->t_max); }

#endif
#endif
