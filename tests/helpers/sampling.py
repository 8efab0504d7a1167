"""Draws of device functions by the renderer's own random numbers, for χ² tests."""

import numpy as np
from stat_tests import chi2_p_value

DRAWS = 1 << 20
RANDOM = "const uint4 k = philox4x32((uint4)(i, 0u, 0u, 0u), (uint2)(11u, 12u));\n"
"""Random words for work-item i, as the renderer draws them."""


def uniforms(*names):
    """OpenCL text that declares up to four uniform numbers of work-item i."""
    return RANDOM + "".join(
        f"const float {n} = uniform_below_one(k.{c});\n" for n, c in zip(names, "xyzw", strict=False)
    )


def uniform_p_value(cells, count):
    """p-value of cell numbers below `count` being equally likely."""
    return chi2_p_value(np.bincount(cells, minlength=count), np.full(count, cells.size / count))
