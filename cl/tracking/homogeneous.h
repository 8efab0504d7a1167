/* Homogeneous media: free flights by the closed form, no majorant and no look-up. */
#ifndef CLVOL_TRACKING_HOMOGENEOUS_H
#define CLVOL_TRACKING_HOMOGENEOUS_H
#if CLVOL_HAS_HOMOGENEOUS
#include "core/random.h"
#include "tracking/channels.h"
#include "tracking/collision.h"

#if CLVOL_EMISSION_ON_WALKS
/* Density, but for the factor T, of a collision that is forced to lie in a segment, which catches the share
   `caught` of all. */
INLINE float forced_density(float sigma_t, float caught, float length)
{
    return caught > 0.0f ? sigma_t / caught : 1.0f / length; /* times T */
}

/* Emission of the segment, at a collision that is forced to lie in it: sigma_a L_e / sigma_t times 1 - T.  It has
   no variance where L_e is constant, and a finite relative variance however thin the medium is.  `first` also decides
   the flight, which is the same in thick media.  Several channels are weighted over their mixture. */
INLINE Spectrum forced_emission(const MediumRay *in, uint first, int channel, Spectrum beta)
{
    const Extinction sigma_t = in->scale, caught = -expm1(-sigma_t * in->t_max);
    const float own = channel_of(caught, channel), rate = channel_of(sigma_t, channel), u = uniform_float(first);
    float t = u * in->t_max; /* for vacuum */
    if (own > 0.0f)
        t = min_of((own < 1.0f ? -log1p(-u * own) : exponential_variate(first)) / rate, in->t_max);
    if (!(t < INFINITY))
        return (Spectrum)(0.0f);
#if CLVOL_EXTINCTION == 3
    const Extinction transmittance = exp_of_minus(sigma_t * t);
    const Extinction density = (Extinction)(forced_density(sigma_t.x, caught.x, in->t_max),
                                            forced_density(sigma_t.y, caught.y, in->t_max),
                                            forced_density(sigma_t.z, caught.z, in->t_max));
    const float chosen = mean3(beta * density * transmittance);
    beta *= chosen > 0.0f ? sigma_t * transmittance * (mean3(beta) / chosen) : (Extinction)(0.0f);
#else
    beta *= caught;
#endif
    return beta * medium_source(in->scene, in->medium, in->world_ray.o + t * in->world_ray.d, in->channel);
}
#endif

INLINE bool homogeneous_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    const Extinction sigma_t = in->scale;
    const int channel = pick_channel(collision->beta, stream_pair(stream));
    const float t = exponential_variate(first) / channel_of(sigma_t, channel); /* infinite for vacuum */
    const float length = min_of(t, in->t_max);
#if CLVOL_EMISSION_ON_WALKS
    collision->emission += forced_emission(in, first, channel, collision->beta);
#endif
    if (!(t < in->t_max)) {
        collision->beta = balanced(collision->beta, (Extinction)(1.0f), sigma_t * length);
        return false;
    }
    collision->beta = balanced(collision->beta, sigma_t, sigma_t * length);
    tally->tentative += 1;
    return real_collision(t, tally, collision);
}

#endif
#endif
