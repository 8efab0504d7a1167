/* The ray that `clvol ray` asks about, and what all its kernels do with it. */
#ifndef CLVOL_RAY_GIVEN_H
#define CLVOL_RAY_GIVEN_H
#include "stages/medium_ray.h"

/* A ray inside one medium: origin (3), direction (3), length, how often the medium is present, its number, channel. */
INLINE MediumRay given_ray(const Scene *scene, __global const float *given)
{
    Ray ray;
    ray.o = load_vector(given);
    ray.d = load_vector(given + 3);
    MediumRay in = medium_ray(scene, scene->media + (int)given[8], ray, given[6], (int)given[9]);
    in.scale *= given[7];
    in.rate *= given[7];
    return in;
}

#endif
