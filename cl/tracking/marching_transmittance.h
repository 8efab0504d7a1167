/* Transmittance by ray marching, a BIASED baseline: exp of a Riemann sum over fixed steps with one jitter. */
#include "tracking/transmittance.h"

INLINE Extinction estimate_transmittance(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
    Extinction depth = (Extinction)(0.0f);
    const float jitter = uniform_float(first), step = in->medium->march_step;
    for (uint i = 0; i < WALK_STEPS; ++i) {
        const float t = (float)i * step;
        if (!(t < in->t_max))
            return exp_of_minus(depth);
        const float length = min_of(step, in->t_max - t);
        depth += length * extinction_at(in, in->index_ray.o + (t + jitter * length) * in->index_ray.d, stream, tally);
    }
    stop_walk((float)WALK_STEPS * step, tally);
    return exp_of_minus(depth);
}
