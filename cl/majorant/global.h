/* Majorant walks cut the stretch [0, t_max] of a MediumRay into segments [t, t_end] along which one bound
   `majorant` of sigma_t holds (per world length).  Each header of this folder implements

       MajorantWalk majorant_begin(medium_ray);
       bool majorant_next(medium_ray, &walk);       false when t_max is reached

   and sets `cell`, the segment's row in the medium's tables of controls; the tracker decides what
   happens inside a segment.  Border cells reach out to infinity, like the clamped look-ups they bound.

   global: one bound for the whole medium, a single segment. */
#ifndef CLVOL_MAJORANT_H
#define CLVOL_MAJORANT_H
#include "tracking/interface.h"

typedef struct {
    float t;
    float t_end;
    float majorant;
    int cell;
} MajorantWalk;

INLINE MajorantWalk majorant_begin(const MediumRay *in)
{
    MajorantWalk walk = {0.0f, 0.0f, in->rate * in->medium->majorant, 0};
    return walk;
}

INLINE bool majorant_next(const MediumRay *in, MajorantWalk *walk)
{
    walk->t = walk->t_end;
    walk->t_end = in->t_max;
    return walk->t < in->t_max;
}

#endif
