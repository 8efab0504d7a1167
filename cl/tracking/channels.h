/* Closed forms: exp(-depth), and distances sampled analytically for several channels at once (METHODS §3,
   regular).  One channel c, picked with probability p_c in proportion to its weight, decides the distance;
   every channel is then weighted over the mixture of all channels' densities, which keeps the mean weight. */
#ifndef CLVOL_TRACKING_CHANNELS_H
#define CLVOL_TRACKING_CHANNELS_H
#include "core/random.h"
#include "tracking/interface.h"

INLINE Extinction exp_of_minus(Extinction depth)
{
#if CLVOL_EXTINCTION == 3
    return (Extinction)(exp(-depth.x), exp(-depth.y), exp(-depth.z));
#else
    return exp(-depth);
#endif
}

#if CLVOL_EXTINCTION == 3
INLINE float channel_of(float3 v, int channel) { return channel == 0 ? v.x : (channel == 1 ? v.y : v.z); }

/* A channel in proportion to |beta|; one of weight 0 is never picked. */
INLINE int pick_channel(float3 beta, uint2 k)
{
    const float x = abs_of(beta.x), y = abs_of(beta.y), z = abs_of(beta.z);
    return choose_event(k.x, x, y + z) ? 0 : (choose_event(k.y, y, z) ? 1 : 2);
}

/* beta after a flight that `density` times the transmittance exp(-depth) describes: density is sigma_t at a
   collision, 1 where the flight left the medium. */
INLINE float3 balanced(float3 beta, float3 density, float3 depth)
{
    const float3 value = density * exp_of_minus(depth);
    const float chosen = mean3(beta * value);
    return chosen > 0.0f ? beta * value * (mean3(beta) / chosen) : (float3)(0.0f);
}
#else
#define channel_of(v, channel) (v)
#define pick_channel(beta, k) 0
#define balanced(beta, density, depth) (beta)
#endif

#endif
