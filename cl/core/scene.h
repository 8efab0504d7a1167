/* The kernels' arguments, and how path slots are read and written.  The text comes from clvol/layout, for what the
   scene uses; `python tools/dump_kernel.py SCENE` shows it. */
#ifndef CLVOL_CORE_SCENE_H
#define CLVOL_CORE_SCENE_H
#include "core/shared.h"
#include "core/types.h"
#include CLVOL_LAYOUT_HEADER

#endif
