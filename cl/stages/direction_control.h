/* A control variate for the direction that a path takes from a collision, towards a light that only next-event
   estimation finds (next_event "control").

   Where the next direction w' comes close to that of the light, s, the next collisions bring much light through the
   peak of the phase function.  How much, by order m of scattering, is about

       F(w') = sum over m of  tau^m / m!  e^-tau  HG_(g^m)(w', s),

   with tau the optical depth to the light, as the cache of lights has it, and g the mean cosine: the unscattered
   light of a slab that the path crosses towards the light, spread by m scatterings.  F(w') less its mean over all w'
   that may be drawn, which has a closed form (phase/convolution.h), is subtracted: a number of mean 0, whatever the
   cache says, since w' is drawn by the phase function and nothing else here depends on it. */
#ifndef CLVOL_STAGES_DIRECTION_CONTROL_H
#define CLVOL_STAGES_DIRECTION_CONTROL_H
#if CLVOL_DIRECTION_CONTROL
#include "core/random.h"
#include "core/scene.h"
#include "phase/convolution.h"

#define CONTROL_ORDERS 2 /* a third takes another 2 % of the variance, and costs more */

/* What is to be added per unit of light, for a path that came along wo and goes on along wi. */
INLINE float direction_control(const Scene *scene, __global const Medium *medium, float transmittance, float3 wo,
                               float3 wi, float3 to_light)
{
    const float g = mean_cosine(scene, medium);
    float order = clamp_to(transmittance, 1e-9f, 1.0f); /* a number whatever the cache holds */
    const float tau = minus_log_of_bits(as_uint(order));
    float sum = 0.0f, lobe = g;
#pragma unroll
    for (int m = 1; m <= CONTROL_ORDERS; ++m, lobe *= g) {
        order *= tau / (float)m;
        sum += order * (phase_convolved(scene, medium, lobe, wo, to_light) - hg_value(lobe, wi, to_light));
    }
    return sum;
}

#endif
#endif
