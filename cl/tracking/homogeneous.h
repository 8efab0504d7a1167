/* Homogeneous media: free flights by the closed form, no majorant and no look-up. */
#ifndef CLVOL_TRACKING_HOMOGENEOUS_H
#define CLVOL_TRACKING_HOMOGENEOUS_H
#include "tracking/channels.h"
#include "tracking/collision.h"

INLINE bool homogeneous_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    const Extinction sigma_t = in->scale;
    const int channel = pick_channel(collision->beta, stream_pair(stream));
    const float t = exponential_variate(first) / channel_of(sigma_t, channel); /* infinite for vacuum */
    const float length = min_of(t, in->t_max);
    if (!(t < in->t_max)) {
        collision->beta = balanced(collision->beta, (Extinction)(1.0f), sigma_t * length);
        return false;
    }
    collision->beta = balanced(collision->beta, sigma_t, sigma_t * length);
    collect_emission(in, t, collision->beta, collision);
    tally->tentative += 1;
    return real_collision(t, tally, collision);
}

#endif
