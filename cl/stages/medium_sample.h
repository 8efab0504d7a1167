/* Walks one interval of one medium to a collision or to the interval's end. */
#ifndef CLVOL_STAGES_MEDIUM_SAMPLE_H
#define CLVOL_STAGES_MEDIUM_SAMPLE_H
#include "stages/medium_ray.h"

INLINE bool medium_collision(const MediumRay *in, uint4 k, Tally *tally, Collision *collision)
{
    Stream stream = stream_begin(k.z, k.w);
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in->medium))
        return homogeneous_collision(in, k.x, &stream, tally, collision);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    return sample_collision(in, k.x, &stream, tally, collision);
#endif
}

#if CLVOL_WEIGHTED
/* Control variate: a walk leaves the path's weight as it is on the mean, so that L (beta before - beta after)
   adds nothing to it for any L that is known before the walk.  With L near what the path will see, the noise
   of the weights all but cancels from the picture; at albedo 1 under a uniform sky it does entirely. */
INLINE void subtract_background(const Scene *scene, uint slot, const MediumRay *in, Spectrum beta)
{
    const Spectrum background = to_spectrum(load_vector(in->medium->background), in->channel);
    set_radiance(scene, slot, get_radiance(scene, slot) + background * (get_beta(scene, slot) - beta));
}
#endif

INLINE void medium_sample(const Scene *scene, uint group, uint slot)
{
    const SampleKey key = path_key(scene, slot);
#if CLVOL_HAS_MANY_MEDIA
    const uint interval = path_interval(scene, slot);
    const float start = path_interval_start(scene, slot);
    __global const Medium *medium = scene->media + path_medium(scene, slot);
#else
    const uint interval = 0;
    const float start = 0.0f;
    __global const Medium *medium = scene->media;
#endif
    Ray ray = path_ray(scene, slot);
    ray.o += start * ray.d;
    const float t_max = path_interval_end(scene, slot) - start;
    const MediumRay in = medium_ray(scene, medium, ray, t_max, (int)path_channel_or_zero(scene, slot));
    const uint4 k = decision_block(render_seed(scene), key, BLOCK_WALK, interval);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    Collision collision;
#if CLVOL_WEIGHTED || CLVOL_EMISSION_ON_WALKS
    collision.beta = get_beta(scene, slot);
    collision.emission = (Spectrum)(0.0f);
#endif
    const bool collided = medium_collision(&in, k, &tally, &collision);
    record_tally(scene, slot, tally);
#if CLVOL_EMISSION_ON_WALKS
    if (!CLVOL_HAS_MAX_DEPTH || scene->render->max_depth > 0)
        set_radiance(scene, slot, get_radiance(scene, slot) + collision.emission);
#endif
#if CLVOL_WEIGHTED
    subtract_background(scene, slot, &in, collision.beta);
    set_beta(scene, slot, collision.beta);
    record_weight(scene, slot, max_of(tally.weight, spectrum_max(collision.beta)));
#endif
#if CLVOL_HAS_OVERLAP
    if (collided) {
        set_path_hit_medium(scene, slot, path_medium(scene, slot));
        set_path_hit_distance(scene, slot, start + collision.t);
    }
    queue_push(scene, group, QUEUE_INTERSECT, slot);
#else
    if (collided) {
        set_path_origin(scene, slot, ray.o + collision.t * ray.d);
        set_path_event(scene, slot, EVENT_COLLISION);
    }
#if CLVOL_HAS_MANY_MEDIA
    queue_push(scene, group, collided ? QUEUE_SHADE : QUEUE_INTERSECT, slot);
#else
    if (!collided)
        set_path_event(scene, slot, EVENT_ESCAPE);
    queue_push(scene, group, QUEUE_SHADE, slot);
#endif
#endif
}

#endif
