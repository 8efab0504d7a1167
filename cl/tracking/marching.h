/* Ray marching, a BIASED baseline: the density is taken as constant over fixed steps, one jittered
   look-up each; the collision lies where the summed optical depth reaches an exponential variate. */
#include "core/random.h"
#include "tracking/collision.h"
#include "tracking/walk.h"

INLINE bool sample_collision(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
    float depth = exponential_variate(first);
    const float jitter = uniform_float(stream_pair(stream).x), step = in->medium->march_step;
    for (uint i = 0; i < WALK_STEPS; ++i) {
        const float t = (float)i * step;
        if (!(t < in->t_max))
            return false;
        const float length = min_of(step, in->t_max - t);
        const float3 p = in->index_ray.o + (t + jitter * length) * in->index_ray.d;
        const float sigma_t = extinction_at(in, p, stream, tally);
        if (sigma_t * length > depth) {
            const float hit = t + depth / sigma_t;
            collect_emission(in, hit, collision->beta, collision);
            tally->tentative += 1;
            return real_collision(hit, tally, collision);
        }
        depth -= sigma_t * length;
    }
    stop_walk((float)WALK_STEPS * step, tally);
    return false;
}
