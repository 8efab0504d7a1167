/* Walks along one ray, watched: collisions by the technique, or estimates of transmittance.
   Reads the ray; writes each walk's outcome (t or -1, weight or estimate (3), tentative, real, look-ups, flaws,
   events) and the events of the first walks. */
#include "ray/recorder.h" /* before the trackers, whose hooks it fills */

#include "core/random.h"
#include "ray/given.h"
#if CLVOL_RAY_COLLISIONS
#include "tracking/homogeneous.h"
#if CLVOL_HAS_HETEROGENEOUS
#include CLVOL_TECHNIQUE_HEADER
#endif
#else
#include "tracking/homogeneous_transmittance.h"
#if CLVOL_HAS_HETEROGENEOUS
#include CLVOL_TRANSMITTANCE_HEADER
#endif
#endif

#define OUTCOME_SIZE 9u
/* Legs of a walk, all in one launch, before it is given up and counted. */
#define MOST_LEGS 256u

#if CLVOL_RAY_COLLISIONS
INLINE bool walk(const MediumRay *in, uint first, Stream *stream, Tally *tally, Collision *collision)
{
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in->medium))
        return homogeneous_collision(in, first, stream, tally, collision);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    return sample_collision(in, first, stream, tally, collision);
#endif
}
#else
INLINE Extinction walk(const MediumRay *in, uint first, Stream *stream, Tally *tally)
{
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in->medium))
        return homogeneous_transmittance(in);
#endif
#if CLVOL_HAS_HETEROGENEOUS
    return estimate_transmittance(in, first, stream, tally);
#endif
}
#endif

__kernel void walks(CLVOL_ARGUMENTS, __global const float *given, __global float *outcomes, __global float *log,
                    uint2 seed, uint walks, uint recorded, uint capacity)
{
    const Scene scene = CLVOL_SCENE;
    const uint i = get_global_id(0);
    if (i >= walks)
        return;
    MediumRay in = given_ray(&scene, given);
    const uint4 k = philox4x32((uint4)(i, 0, 0, 0), seed);
    Stream stream = stream_begin(k.z, k.w);
    Recorder recorder = {{0, 0, 0, 0, 0, 0, 0.0f},
                         log + i * capacity * EVENT_SIZE,
                         0,
                         i < recorded ? capacity : 0,
                         0.0f,
                         (float3)(1.0f)};
    Tally *tally = &recorder.tally;
    uint first = k.x;
    float t = -1.0f;
#if CLVOL_RAY_COLLISIONS
    Collision collision;
    collision.beta = (Spectrum)(1.0f);
    collision.emission = (Spectrum)(0.0f);
#endif
    for (uint leg = 0; leg == 0 || tally->stopped; ++leg) {
        if (leg == MOST_LEGS) {
            tally->exhausted += 1;
            break;
        }
        if (leg > 0) {
            in = rest_of_ray(in, tally->stop_t);
            recorder.begun += tally->stop_t;
            tally->stopped = 0;
            first = stream_pair(&stream).x;
        }
#if CLVOL_RAY_COLLISIONS
        if (walk(&in, first, &stream, tally, &collision))
            t = recorder.begun + collision.t;
#else
        recorder.share *= (float3)(walk(&in, first, &stream, tally));
#endif
    }
#if CLVOL_RAY_COLLISIONS
    const float3 value = (float3)(collision.beta);
#else
    const float3 value = recorder.share;
#endif
    __global float *outcome = outcomes + i * OUTCOME_SIZE;
    outcome[0] = t;
    vstore3(value, 0, outcome + 1);
    outcome[4] = (float)tally->tentative;
    outcome[5] = (float)tally->real;
    outcome[6] = (float)tally->lookups;
    outcome[7] = (float)(tally->violations + tally->exhausted);
    outcome[8] = (float)recorder.events;
}
