/* Light that a walk brings by expectation, instead of by whether the path collides (background "expected").

   A walk leaves estimates T of the transmittance, R of the chance of a collision, S of that in the light of the sun, and
   one of its tentative collisions (tracking/delta_through.h).  With L the light behind, C what collisions bring that no sun
   lights and A what a fully lit one brings, the picture gets

       T L + (1 - T) C + S A,

   and with the probability q the path goes on from the collision, with the weight R / q, to bring what it finds
   less C + lit A: control variates, since on the mean R is 1 - T and S that of `lit` at the chosen collision.  The
   mean is the same for any C and A that are known before the walk.  q is what makes the path weigh FOLLOWED_WEIGHT,
   or no more than before: more often than walks collide where the medium is thin.  Single samples may be negative. */
#ifndef CLVOL_STAGES_BACKGROUND_H
#define CLVOL_STAGES_BACKGROUND_H
#if CLVOL_EXPECTS_BACKGROUND
#include "core/random.h"
#include "core/scene.h"
#include "medium/albedo.h"
#include "path/weight.h"
#include "phase/phase.h"
#include "phase/varied.h"
#include "stages/escape.h"
#include "tracking/collision.h"
#if CLVOL_SUN_CONTROL
#include "emitter/sunlit.h"
#endif

/* The rate of tentative collisions of the walk that is next on the path: of camera paths in thin media, whose sums are
   most of the noise, twice what majorants ask for. */
INLINE float expecting_rate(const Scene *scene, uint slot, float rate)
{
    return path_bounce(scene, slot) == 0 ? scene->media->camera_rate * rate : rate;
}

/* A random number for whether the path goes on, of those that seed its walk. */
INLINE uint following_number(uint4 k) { return mixed_bits(mixed_bits(k.z ^ 0x85EBCA6Bu) ^ k.w); }

/* Light that a collision of the path's ray, which starts at p, brings where the sun is not in its way. */
INLINE Spectrum fully_lit(const Scene *scene, uint slot, float3 p, float3 wo)
{
#if CLVOL_SUN_CONTROL
    __global const Medium *medium = scene->media;
    __global const Emitter *sun = scene->emitters + weighed_light(scene, sun_row(scene));
    const int channel = (int)path_channel(scene, slot);
    if (!medium->sample_emitters ||
        sun->kind != EMITTER_DIRECTIONAL) /* a weak one that the cache does not tell apart */
        return (Spectrum)(0.0f);
    return to_spectrum(emitter_value(sun), channel) * medium_albedo(scene, medium, p, channel) *
           PHASE_PDF(p, wo, -load_vector(sun->vector));
#else
    return (Spectrum)(0.0f);
#endif
}

/* Adds what a walk from p in the scene's one medium brings; k: following_number of its numbers.  Returns whether the path goes
   on from the collision.  `stopped`: the walk was cut short, so that the path goes on from there or from its end. */
INLINE bool expect_light(const Scene *scene, uint slot, float3 p, Expected expected, bool met, bool stopped, uint k)
{
    const Spectrum beta = path_beta(scene, slot);
    Spectrum inside = to_spectrum(load_vector(scene->media->background), (int)path_channel(scene, slot));
    Spectrum sunny = fully_lit(scene, slot, p, path_direction(scene, slot));
#if CLVOL_HAS_MAX_DEPTH
    if (path_bounce(scene, slot) + 1 >= scene->render->max_depth) { /* nothing scatters any more */
        inside *= 0.0f;
        sunny *= 0.0f;
    }
#endif
    Spectrum behind = (Spectrum)(0.0f);
#if CLVOL_HAS_CONSTANT || CLVOL_HAS_ENVMAP || CLVOL_HAS_BACKDROP
    if (!stopped)
        behind = escape_light(scene, slot);
#endif
    if (stopped)
        behind = inside; /* of what is still to come */
    Spectrum added = beta * (behind * expected.through + inside * (1.0f - expected.through) + sunny * expected.lit);
    const float weight = spectrum_max(beta);
    float follows = weight * expected.caught / min_of(weight, FOLLOWED_WEIGHT);
    if (stopped)
        follows = expected.caught / (expected.caught + expected.through);
    const bool goes_on = met && (follows >= 1.0f || uniform_float(k) < follows);
    follows = min_of(follows, 1.0f);
    Spectrum after = (Spectrum)(0.0f);
    if (goes_on) {
        after = beta * (expected.caught / follows);
        added -= after * (inside + sunny * expected.met_lit);
    } else if (stopped) {
        after = beta * (expected.caught + expected.through); /* through / (1 - follows), that is */
        added -= after * inside;
    }
#if CLVOL_HAS_ALPHA
    if (!stopped)
        let_through(scene, slot, expected.through);
#endif
    set_path_radiance(scene, slot, path_radiance(scene, slot) + added);
    set_path_beta(scene, slot, after);
    return goes_on;
}

#endif
#endif
