/* Hooks through which `clvol ray` watches a walk.  Renders leave them empty; cl/ray/recorder.h, included before
   the trackers, fills them. */
#ifndef CLVOL_TRACKING_RECORD_H
#define CLVOL_TRACKING_RECORD_H

#ifndef RECORD_WALKS
#define RECORD_TENTATIVE(t, rate, tally)    /* a tentative collision at t of a walk of that rate */
#define RECORD_LOOKUP(in, p, sigma_t, tally) /* what a look-up at index position p found */
#define RECORD_NULL(beta, tally)            /* weight after a null collision, of techniques that change it */
#define RECORD_REAL(t, beta, tally)         /* a real collision and the weight there */
#define RECORD_ESTIMATE(t, estimate, tally) /* the transmittance from the start to t, as estimated so far */
#endif

#endif
