/* A walk through one medium, and what it leaves with the path. */
#ifndef CLVOL_STAGES_MEDIUM_COLLISION_H
#define CLVOL_STAGES_MEDIUM_COLLISION_H
#if CLVOL_HAS_MEDIA
#include "core/random.h"
#include "path/tally.h"
#include "path/weight.h"
#include "stages/legs.h"
#include "stages/medium_ray.h"
#if CLVOL_HAS_HETEROGENEOUS
#include CLVOL_TECHNIQUE_HEADER
#include "tracking/thin_emission.h"
#endif
#include "tracking/homogeneous.h"

/* Where the path's walk begins, at `from`, or goes on. */
INLINE Walked walked_so_far(const Scene *scene, uint slot, float from)
{
    Walked walked = {path_leg(scene, slot), from, 0.0f};
    if (walked.leg > 0) {
        walked.t = path_walked(scene, slot);
        walked.rest = path_walked_rest(scene, slot);
    }
    return walked;
}

/* The same, said once. */
INLINE Walked take_walked(const Scene *scene, uint slot, float from)
{
    const Walked walked = walked_so_far(scene, slot, from);
    if (walked.leg > 0)
        set_path_leg(scene, slot, 0);
    return walked;
}

INLINE void set_walked(const Scene *scene, uint slot, Walked walked)
{
    set_path_leg(scene, slot, walked.leg);
    set_path_walked(scene, slot, walked.t);
    set_path_walked_rest(scene, slot, walked.rest);
}

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
INLINE void subtract_background(const Scene *scene, uint slot, __global const Medium *medium, int channel,
                                Spectrum beta)
{
    const Spectrum background = to_spectrum(load_vector(medium->background), channel);
    set_path_radiance(scene, slot, path_radiance(scene, slot) + background * (path_beta(scene, slot) - beta));
}
#endif

/* A walk's result but for the way: what it cost, weighed and met. */
INLINE void record_walk(const Scene *scene, uint slot, Tally tally, Spectrum beta, Spectrum emission)
{
    record_tally(scene, slot, tally);
#if CLVOL_EMISSION_ON_WALKS
    if (!CLVOL_HAS_MAX_DEPTH || scene->render->max_depth > 0)
        set_path_radiance(scene, slot, path_radiance(scene, slot) + emission);
#endif
#if CLVOL_WEIGHTED
    set_path_beta(scene, slot, beta);
    record_weight(scene, slot, max_of(tally.weight, spectrum_max(beta)));
#endif
}

#endif
#endif
