/* Walks the media ahead to a collision, or to the surface or infinity behind them. */
#ifndef CLVOL_STAGES_MEDIUM_SAMPLE_H
#define CLVOL_STAGES_MEDIUM_SAMPLE_H
#include "stages/medium_ray.h"

/* Where the path's walk begins, or goes on: `from` where it has not begun. */
#if CLVOL_HAS_HETEROGENEOUS
CLVOL_WALKED_FIELD()
#else
INLINE Walked get_walked(const Scene *scene, uint slot, float from)
{
    const Walked walked = {0, from, 0.0f};
    return walked;
}
#define set_walked(scene, slot, walked)
#endif

INLINE bool medium_collision(const MediumRay *in, uint4 k, Tally *tally, Collision *collision)
{
    tally->stopped = 0;
    Stream stream = stream_begin(k.z, k.w);
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in->medium))
        return homogeneous_collision(in, k.x, &stream, tally, collision);
#endif
#if CLVOL_HAS_HETEROGENEOUS
#if CLVOL_EMISSION_ON_WALKS
    if (is_thin(in)) {
        const Spectrum before = collision->emission;
        const Spectrum emission = thin_emission(in, k.x, &stream, tally, collision->beta);
        const bool collided = sample_collision(in, k.x, &stream, tally, collision);
        collision->emission = before; /* instead of what the walk met */
        if (!tally->stopped || thin_point(in, k.x) < tally->stop_t) /* beyond, the next leg gathers it */
            collision->emission += emission;
        return collided;
    }
#endif
    return sample_collision(in, k.x, &stream, tally, collision);
#endif
}

#if CLVOL_WEIGHTED
/* Control variate: a walk leaves the path's weight as it is on the mean, so that L (beta before - beta after)
   adds nothing to it for any L that is known before the walk.  With L near what the path will see, the noise
   of the weights all but cancels from the picture; at albedo 1 under a uniform sky it does entirely. */
INLINE void subtract_background(const Scene *scene, uint slot, __global const Medium *medium, int channel, Spectrum beta)
{
    const Spectrum background = to_spectrum(load_vector(medium->background), channel);
    set_radiance(scene, slot, get_radiance(scene, slot) + background * (get_beta(scene, slot) - beta));
}
#endif

/* A walk's result but for the way: what it cost, weighed and met. */
INLINE void record_walk(const Scene *scene, uint slot, Tally tally, Spectrum beta, Spectrum emission)
{
    record_tally(scene, slot, tally);
#if CLVOL_EMISSION_ON_WALKS
    if (!CLVOL_HAS_MAX_DEPTH || scene->render->max_depth > 0)
        set_radiance(scene, slot, get_radiance(scene, slot) + emission);
#endif
#if CLVOL_WEIGHTED
    set_beta(scene, slot, beta);
    record_weight(scene, slot, max_of(tally.weight, spectrum_max(beta)));
#endif
}

#if CLVOL_HAS_STRETCHES
#include "stages/stretch_sample.h"
#else
/* The one medium of the scene, from the ray's start.  Returns the steps that it took. */
INLINE uint medium_sample(const Scene *scene, uint group, uint slot)
{
    const SampleKey key = path_key(scene, slot);
    const Ray ray = path_ray(scene, slot);
    const Walked walked = get_walked(scene, slot, 0.0f);
    const MediumRay in = rest_of_ray(medium_ray(scene, scene->media, ray, path_interval_end(scene, slot),
                                                (int)path_channel_or_zero(scene, slot)),
                                     walked.t);
    const uint4 k = leg_block(decision_block(scene, key, BLOCK_WALK, 0), walked.leg);
    Tally tally = {0, 0, 0, 0, 0, 0, 0.0f};
    Collision collision;
    collision.beta = get_beta(scene, slot);
    collision.emission = (Spectrum)(0.0f);
    const bool collided = medium_collision(&in, k, &tally, &collision);
    const bool stopped = goes_on(walked, &tally);
#if CLVOL_WEIGHTED
    subtract_background(scene, slot, in.medium, in.channel, collision.beta);
#endif
    record_walk(scene, slot, tally, collision.beta, collision.emission);
    if (stopped) {
        set_walked(scene, slot, walk_on(walked, walked.t, tally.stop_t));
        set_path_event(scene, slot, EVENT_WALK);
    } else if (collided) {
        set_path_origin(scene, slot, ray.o + (walked.t + collision.t) * ray.d);
        set_path_event(scene, slot, EVENT_COLLISION);
    }
    queue_push(scene, group, QUEUE_SHADE, slot);
    return steps_of(&tally);
}
#endif

#endif
