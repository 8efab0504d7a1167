/* Majorant walks cut the stretch [0, t_max] of an index-space ray into segments [t, t_end] along which
   one bound `majorant` of sigma_t holds (per world length).  Each header of this folder implements

       MajorantWalk majorant_begin(scene, medium, ray, t_max);
       bool majorant_next(scene, medium, &walk);       false when t_max is reached

   and the tracker decides what happens inside a segment.  Border cells reach out to infinity, like
   the clamped look-ups they bound.

   global: one bound for the whole medium, a single segment. */
#ifndef CLVOL_MAJORANT_H
#define CLVOL_MAJORANT_H

typedef struct {
    float t;
    float t_end;
    float majorant;
    float t_max;
} MajorantWalk;

INLINE MajorantWalk majorant_begin(const Scene *scene, __global const Medium *medium, Ray ray, float t_max)
{
    MajorantWalk walk = {0.0f, 0.0f, medium->majorant, t_max};
    return walk;
}

INLINE bool majorant_next(const Scene *scene, __global const Medium *medium, MajorantWalk *walk)
{
    walk->t = walk->t_end;
    walk->t_end = walk->t_max;
    return walk->t < walk->t_max;
}

#endif
