/* Walks in lanes: what stages and trackers implement, and what they are given.  The loop is in kernels/lanes.cl.

       SampleKey lane_key(scene, slot, &segment);               a stage; whose numbers of block LANE_BLOCK a walk
                                                                begins with
       bool lane_begin(scene, group, slot, &walk);              a stage, given these; false where the path needs no
                                                                walk and has been handed on
       void lane_end(scene, group, &path, &arrival);            a stage: books a walk, and hands the path on
       Int lane_event(&state, density, k, ready);               a tracker: a tentative collision in the lanes that
                                                                are ready; returns those whose walks end by it */
#ifndef CLVOL_TRACKING_LANES_H
#define CLVOL_TRACKING_LANES_H
#if CLVOL_LANES
#include "core/lane_random.h"
#if CLVOL_EXPECTS_BACKGROUND
#include "tracking/collision.h"
#endif
#include "tracking/interface.h"

/* What a walk begins with, and for the stage alone where on the path's ray. */
typedef struct {
    MediumRay in;
    uint4 k; /* the first distance, -, the stream's seed (2) */
    float depth; /* that k.x stands for, to be walked to the first tentative collision */
    float from;
} LaneWalk;

/* What the stage needs to know at its end. */
typedef struct {
    uint slot;
    float from;
    float3 start; /* in the world */
#if CLVOL_EXPECTS_BACKGROUND
    uint4 k; /* as LaneWalk's */
#endif
#if CLVOL_HAS_GLOW
    float length; /* of what was to be walked */
#endif
} LanePath;

/* What a walk came to. */
typedef struct {
    float t;
    bool happened;  /* what ends walks of its tracker */
    float estimate; /* of transmittance */
#if CLVOL_EXPECTS_BACKGROUND
    Expected expected;
#endif
    Tally tally;
} LaneArrival;

/* Where the walks stand.  Depths, and bounds of density, leave the medium's scale out. */
typedef struct {
    Real t, t_end, bound, depth, estimate;
#if CLVOL_EXPECTS_BACKGROUND
    Real share;                      /* of the rate of tentative collisions that the majorant asks for */
    Real here;                       /* how much of the sun's light arrives */
    Real met, met_lit, caught, lit;  /* the chosen collision, and sums (tracking/delta_through.h) */
#endif
    LaneStream stream;
    Int lookups, cells, violations, happened, alive;
} LaneState;

#endif

#endif
