/* Inversion of tabulated distributions. */
#ifndef CLVOL_EMITTER_CDF_H
#define CLVOL_EMITTER_CDF_H
#include "core/math.h"

/* First index i in [0, n) with cdf[i + 1] > u; cdf has n + 1 entries from 0 to 1.  An entry of probability 0 is
   never found. */
INLINE int cdf_search(__global const float *cdf, int n, float u)
{
    int lower = 0, upper = n - 1;
    while (lower < upper) {
        const int middle = (lower + upper) >> 1;
        if (cdf[middle + 1] > u)
            upper = middle;
        else
            lower = middle + 1;
    }
    return lower;
}

#endif
