/* Walks along one ray, watched: COLLISIONS by the technique, else estimates of transmittance.
   Reads the ray; writes each walk's outcome (t or -1, weight or estimate (3), tentative, real, look-ups, flaws,
   events) and the events of the first walks. */
#include "ray/given.h"

#define OUTCOME_SIZE 9u

__kernel void walks(CLVOL_ARGUMENTS, __global const float *given, __global float *outcomes, __global float *log,
                    uint2 seed, uint walks, uint recorded, uint capacity)
{
    const Scene scene = CLVOL_SCENE;
    const uint i = get_global_id(0);
    if (i >= walks)
        return;
    const MediumRay in = given_ray(&scene, given);
    const uint4 k = philox4x32((uint4)(i, 0, 0, 0), seed);
    Stream stream = stream_begin(k.z, k.w);
    Recorder recorder = {{0, 0, 0, 0, 0, 0, 0.0f}, log + i * capacity * EVENT_SIZE, 0, i < recorded ? capacity : 0};
    Tally *tally = &recorder.tally;
    float t = -1.0f;
#ifdef COLLISIONS
    Collision collision;
    collision.t = -1.0f;
    collision.beta = (Spectrum)(1.0f);
    collision.emission = (Spectrum)(0.0f);
    bool collided;
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in.medium))
        collided = homogeneous_collision(&in, k.x, &stream, tally, &collision);
#if CLVOL_HAS_HETEROGENEOUS
    else
#endif
#endif
#if CLVOL_HAS_HETEROGENEOUS
        collided = sample_collision(&in, k.x, &stream, tally, &collision);
#endif
    t = collided ? collision.t : -1.0f;
    const float3 value = (float3)(collision.beta);
#else
    Extinction estimate;
#if CLVOL_HAS_HOMOGENEOUS
    if (is_homogeneous(in.medium))
        estimate = homogeneous_transmittance(&in);
#if CLVOL_HAS_HETEROGENEOUS
    else
#endif
#endif
#if CLVOL_HAS_HETEROGENEOUS
        estimate = estimate_transmittance(&in, k.x, &stream, tally);
#endif
    const float3 value = (float3)(estimate);
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
