"""Pictures of eight bits: what lies between two codes is shown by how many pixels have either.

Rounding alone gives a smooth sky bands that are seen.  Each pixel has a threshold of its own, from a sequence
that covers [0, 1) evenly over any small patch of pixels (Roberts 2018, "The unreasonable effectiveness of
quasirandom sequences"), so that the mean over a patch is that of the picture.  It depends on the place alone:
the same picture has the same bits, and grey stays grey.
"""

from __future__ import annotations

import numpy as np

from clvol.base.rows import bands

_STEP = 0.7548776662466927, 0.5698402909980532
"""1/φ and 1/φ² of the plastic number φ."""
_ROUNDING = 1e-4
"""Of a code: what lies so little below one is it."""


def thresholds(rows: slice, width: int) -> np.ndarray:
    """Of the pixels of some rows, float64 (rows, width) in [0, 1)."""
    across, down = np.arange(width) * _STEP[0], np.arange(rows.start, rows.stop) * _STEP[1]
    found: np.ndarray = (down[:, None] + across + 0.5) % 1.0
    return found


def codes(display: np.ndarray) -> np.ndarray:
    """A picture of values from 0 to 1, (height, width, channels), as uint8; alpha, the fourth, is rounded.

    What is a code, as black and white are, stays that one, and everything else one of the two beside it.
    """
    height, width, channels = display.shape
    found = np.empty(display.shape, np.uint8)
    for rows in bands(height, width):
        part = 255.0 * display[rows].astype(np.float64)
        place = thresholds(slice(rows.start, rows.start + len(part)), width)
        found[rows, :, :3] = np.floor(part[..., :3] + place[..., None] * (1 - _ROUNDING) + _ROUNDING)
        if channels > 3:
            found[rows, :, 3] = np.rint(part[..., 3])
    return found
