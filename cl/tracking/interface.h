/* What a technique is: two functions over the part of a ray that lies in one medium.

       bool sample_collision(medium_ray, first, stream, tally, &collision)
       Extinction estimate_transmittance(medium_ray, first, stream, tally)

   A technique header implements the first, a transmittance header the second; either walks the
   majorant's segments and reads density through extinction_at() (tracking/walk.h).  `first` is the
   numbered dimension of the first distance; everything later comes from the stream.

   sample_collision returns whether the ray collided; `collision->beta`, the path's whole weight, is
   multiplied by the walk's weight either way, and `collision->emission` gathers the light met on the way. */
#ifndef CLVOL_TRACKING_INTERFACE_H
#define CLVOL_TRACKING_INTERFACE_H
#include "tracking/tally.h"

/* Look-ups of one walk before it is given up and counted: no loop in a kernel is without a bound. */
#define WALK_BUDGET (1u << 26)

/* The stretch 0 <= t <= t_max of a ray that lies in one medium, t in world lengths. */
typedef struct {
    const Scene *scene;
    __global const Medium *medium;
    Ray ray;          /* in the index space of sigma_t, where one is */
    Ray world;        /* the same in world space */
    float t_max;
    int channel;      /* the one followed, where a path follows one */
    Extinction scale; /* sigma_t = scale * density; the coefficient itself where it is constant */
    float rate;       /* majorant = rate * bound */
} MediumRay;

#endif
