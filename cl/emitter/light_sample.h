/* What next-event estimation draws: one direction towards one light. */
#ifndef CLVOL_EMITTER_LIGHT_SAMPLE_H
#define CLVOL_EMITTER_LIGHT_SAMPLE_H
#include "core/scene.h"

typedef struct {
    uint number;      /* of the light */
    float chosen;     /* probability of that light */
    float3 direction; /* towards the light */
    float distance;   /* to the light's point */
    float3 value;     /* light arriving, over the probability of this choice */
    float pdf;        /* of the direction, choice of light included; 0: no other way to find it (no MIS) */
    uint primitive;   /* that the light's point lies on; NO_PRIMITIVE where the light is no surface */
} LightSample;

INLINE float3 emitter_value(__global const Emitter *emitter)
{
    return (float3)(emitter->value[0], emitter->value[1], emitter->value[2]);
}

#endif
