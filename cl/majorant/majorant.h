/* Majorant walks cut [0, t_max] of a MediumRay into segments [t, t_end] along which one bound
   `majorant` of sigma_t holds (per world length).  Each header that --majorant names implements

       MajorantWalk majorant_begin(medium_ray);
       bool majorant_next(medium_ray, &walk);       false when t_max is reached

   and sets `cell`, the segment's row in the medium's tables of controls; the tracker decides what
   happens inside a segment.  Border cells reach out to infinity, like the clamped look-ups they bound. */
#ifndef CLVOL_MAJORANT_MAJORANT_H
#define CLVOL_MAJORANT_MAJORANT_H
#include CLVOL_MAJORANT_HEADER

#endif
