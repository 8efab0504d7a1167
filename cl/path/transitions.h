/* How the stage at hand hands its paths on: a function for each transition of its contract (clvol/layout/stages.py),
   from which the text is made, and the events that these may leave.  There are no others, but for from_idle() of the stage that wakes slots: a stage cannot push to a
   queue that its contract does not name.  `python tools/dump_kernel.py SCENE` shows what a stage has. */
#ifndef CLVOL_PATH_TRANSITIONS_H
#define CLVOL_PATH_TRANSITIONS_H
#include "path/queues.h"
#include CLVOL_CONTRACT_HEADER

#endif
