/* Watches a walk: fills the hooks of tracking/record.h with a log of what happens, in order.  Included before the
   trackers, which then run as they do in a render. */
#ifndef CLVOL_RAY_RECORDER_H
#define CLVOL_RAY_RECORDER_H
#include "core/math.h"
#include "core/types.h"
#include "tracking/tally.h"

/* An event: its kind, its distance along the ray, three numbers. */
#define EVENT_TENTATIVE 0 /* the rate of tentative collisions */
#define EVENT_LOOKUP 1    /* sigma_t by channel */
#define EVENT_NULL 2      /* weight by channel */
#define EVENT_REAL 3      /* weight by channel */
#define EVENT_ESTIMATE 4  /* transmittance by channel */
#define EVENT_SIZE 5u

/* The tally comes first: trackers are handed its address, and the hooks find the log behind it. */
typedef struct {
    Tally tally;
    __global float *log;
    uint events;   /* that happened */
    uint capacity; /* of the log: later ones are only counted */
    float begun;   /* where on the ray the walk's leg began */
    float3 share;  /* the estimate up to there */
} Recorder;

INLINE void record_event(Tally *tally, int kind, float t, float3 value)
{
    Recorder *recorder = (Recorder *)tally;
    if (recorder->events < recorder->capacity) {
        __global float *event = recorder->log + recorder->events * EVENT_SIZE;
        event[0] = (float)kind;
        event[1] = recorder->begun + t;
        vstore3(value, 0, event + 2);
    }
    recorder->events += 1;
}

/* The ray parameter of an index position: of use to a picture, too coarse for anything else. */
INLINE float parameter_of(Ray ray, float3 p) { return dot_of(p - ray.o, ray.d) / dot_of(ray.d, ray.d); }

#define RECORD_WALKS
#define RECORD_TENTATIVE(t, rate, tally) record_event(tally, EVENT_TENTATIVE, t, (float3)(rate))
#define RECORD_LOOKUP(in, p, sigma_t, tally) \
    record_event(tally, EVENT_LOOKUP, parameter_of((in)->index_ray, p), (float3)(sigma_t))
#define RECORD_NULL(beta, tally) record_event(tally, EVENT_NULL, 0.0f, (float3)(beta))
#define RECORD_REAL(t, beta, tally) record_event(tally, EVENT_REAL, t, (float3)(beta))
#define RECORD_ESTIMATE(t, estimate, tally) \
    record_event(tally, EVENT_ESTIMATE, t, (float3)(estimate) * ((Recorder *)(tally))->share)

#endif
