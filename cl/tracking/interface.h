/* What a technique is: two functions over the segment of a ray that lies in one medium.

       bool sample_collision(medium_ray, first, stream, tally, &collision)
       Extinction estimate_transmittance(medium_ray, first, stream, tally)

   A technique header implements the first, a transmittance header the second; either walks the
   majorant's segments and reads density through extinction_at() (tracking/walk.h).  `first` is the
   numbered dimension of the first distance; everything later comes from the stream.

   sample_collision returns whether the ray collided; `collision->beta`, the path's whole weight, is
   multiplied by the walk's weight either way, and `collision->emission` gathers the light met on the way.

   Both may stop short, with stop_walk(): what they return then holds up to there, with no collision so far. */
#ifndef CLVOL_TRACKING_INTERFACE_H
#define CLVOL_TRACKING_INTERFACE_H
#include "core/scene.h"
#include "tracking/tally.h"

/* A walk goes in legs, so that no launch takes long: after WALK_STEPS steps it stops where it is, and another walk
   goes on from there in the next wave.  Nothing is kept but its place and the path's weight, since a free flight
   has no memory: any point that it reached without a collision is as good a start as the first.  After WALK_LEGS
   legs it is given up and counted: no loop is without a bound. */
#define WALK_STEPS (1u << 12)
#define WALK_LEGS (1u << 14)

/* The segment 0 <= t <= t_max of a ray that lies in one medium, t in world lengths. */
typedef struct {
    const Scene *scene;
    __global const Medium *medium;
    Ray index_ray;    /* in the index space of sigma_t, where one is */
    Ray world_ray;    /* the same in world space */
    float t_max;
    int channel;      /* the one followed, where a path follows one */
    Extinction scale; /* sigma_t = scale * density; the coefficient itself where it is constant */
    float rate;       /* majorant = rate * bound */
#if CLVOL_HAS_VARIED_AREAS
    int flakes;       /* the volume by whose microflakes the extinction goes, as well; -1 for none */
    float most_area;  /* of these, which `scale` has */
    Ray flake_ray;    /* the ray in its index space */
#endif
} MediumRay;

INLINE void stop_walk(float t, Tally *tally)
{
    tally->stopped = 1;
    tally->stop_t = t;
}

/* What is left of a ray from t on. */
INLINE MediumRay rest_of_ray(MediumRay in, float t)
{
    in.index_ray.o += t * in.index_ray.d;
    in.world_ray.o += t * in.world_ray.d;
#if CLVOL_HAS_VARIED_AREAS
    in.flake_ray.o += t * in.flake_ray.d;
#endif
    in.t_max -= t;
    return in;
}

#endif
