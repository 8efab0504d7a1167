#ifndef CLVOL_TRACKING_TALLY_H
#define CLVOL_TRACKING_TALLY_H

/* What a walk cost and met, for AOVs and statistics. */
typedef struct {
    uint lookups;
    uint tentative;  /* tentative collisions */
    uint real;       /* real collisions */
    uint cells;      /* majorant cells crossed */
    uint violations; /* look-ups above their majorant */
    uint exhausted;  /* walks that used up WALK_BUDGET */
    float weight;    /* largest absolute weight on the way, of techniques that change it */
} Tally;

#endif
