/* What a technique fills in. */
#ifndef CLVOL_TRACKING_COLLISION_H
#define CLVOL_TRACKING_COLLISION_H
#if CLVOL_EMISSION_ON_WALKS
#include "medium/emission.h"
#endif
#include "tracking/interface.h"
#include "tracking/record.h"

#if CLVOL_EXPECTS_BACKGROUND
/* What a walk to the end of its stretch estimates (tracking/delta_through.h). */
typedef struct {
    float through; /* transmittance */
    float caught;  /* chance of a collision */
    float lit;     /* the same times the light of the sun that arrives */
    float met_lit; /* that light at the collision that was chosen */
} Expected;
#endif

typedef struct {
    float t;           /* out: ray parameter of the collision */
    Spectrum beta;     /* in and out: weight of the path */
    Spectrum emission; /* in and out: emitted light that reached the path's start, weighted */
#if CLVOL_EXPECTS_BACKGROUND
    Expected expected; /* out */
#endif
} Collision;

/* Ends a real collision's walk. */
INLINE bool real_collision(float t, Tally *tally, Collision *collision)
{
    tally->real += 1;
    collision->t = t;
    RECORD_REAL(t, collision->beta, tally);
    return true;
}

/* Adds the emission met at t by a path of weight `beta` per unit of extinction (METHODS §2): at every
   tentative collision beta is w sigma_t / sigma_maj. */
INLINE void collect_emission(const MediumRay *in, float t, Spectrum beta, Collision *collision)
{
#if CLVOL_EMISSION_ON_WALKS
    const float3 p = in->world_ray.o + t * in->world_ray.d;
    collision->emission += beta * medium_source(in->scene, in->medium, p, in->channel);
#endif
}

#endif
