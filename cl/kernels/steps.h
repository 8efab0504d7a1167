/* How far a work-item walks in one launch. */
#ifndef CLVOL_KERNELS_STEPS_H
#define CLVOL_KERNELS_STEPS_H

/* Steps beyond which it leaves its other paths to the next wave, so that no launch takes long. */
#define STAGE_STEPS (1u << 13)

#endif
