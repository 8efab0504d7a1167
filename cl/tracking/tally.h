#ifndef CLVOL_TRACKING_TALLY_H
#define CLVOL_TRACKING_TALLY_H

/* What a walk cost and met, for AOVs and statistics. */
typedef struct {
    uint lookups;
    uint tentative;  /* tentative collisions */
    uint real;       /* real collisions */
    uint cells;      /* majorant cells crossed */
    uint violations; /* look-ups above their majorant */
    uint exhausted;  /* walks that used up their bound */
    float weight;    /* largest absolute weight on the way, of techniques that change it */
    uint stopped;    /* 1: the last walk used up its steps, and is to go on from stop_t */
    float stop_t;
} Tally;

#endif
