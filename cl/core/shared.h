/* What host and device share whatever the scene: records, numbered kinds, numbers, and the Scene: a pointer
   for every buffer that there may be, null where the scene has none.  The text comes from clvol/layout. */
#ifndef CLVOL_CORE_SHARED_H
#define CLVOL_CORE_SHARED_H
#include CLVOL_SHARED_HEADER

#endif
