/* A lattice whose places are found through a tree of nodes of 8³ entries, the root first, so that memory
   follows what differs from its surroundings.  An entry that is negative, -n, leads to node n; any other is
   the value of all the places that it stands for. */
#ifndef CLVOL_GEOMETRY_LATTICE_TREE_H
#define CLVOL_GEOMETRY_LATTICE_TREE_H
#include "core/math.h"

/* The value at a place below 8^levels; *shift: the entry that holds it is a cube of 2^shift places an axis. */
INLINE int tree_find(__global const int *nodes, int levels, int x, int y, int z, int *shift)
{
    int value = 0;
    *shift = 3 * levels;
    do {
        *shift -= 3;
        value = nodes[-value * 512 + ((z >> *shift & 7) << 6 | (y >> *shift & 7) << 3 | (x >> *shift & 7))];
    } while (value < 0 && *shift > 0);
    return value;
}

#endif
