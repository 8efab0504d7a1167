/* What a technique is: two functions over an index-space ray that starts at t = 0 inside a medium.

       bool sample_collision(scene, medium, ray, t_max, first, stream, tally, &collision)
       float estimate_transmittance(scene, medium, ray, t_max, channel, first, stream, tally)

   A technique header implements the first, a transmittance header the second; either walks the
   majorant's segments and reads density through volume_value().  `first` is the numbered dimension
   of the first distance; everything later comes from the stream. */
#ifndef CLVOL_TRACKING_INTERFACE_H
#define CLVOL_TRACKING_INTERFACE_H

/* Look-ups of one walk before it is given up and counted: no loop in a kernel is without a bound. */
#define WALK_BUDGET (1u << 26)

/* What a walk cost and met, for AOVs and statistics. */
typedef struct {
    uint lookups;
    uint violations; /* look-ups above their majorant */
    uint exhausted;  /* walks that used up WALK_BUDGET */
} Tally;

/* In: the channel to follow.  Out: the ray parameter of the collision. */
typedef struct {
    int channel;
    float t;
} Collision;

#endif
