"""Three-channel grids whose channels are multiples of one another, as one channel and three factors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.volumes.check import SLAB

if TYPE_CHECKING:
    from clvol.volumes.grid import DenseGrid

TOLERANCE = 2.0**-20
"""Largest relative deviation from proportionality: sixteen roundings of a float."""


def proportional_channels(grid: DenseGrid) -> tuple[DenseGrid, tuple[float, ...]] | None:
    """One channel and what it must be multiplied by, or None where the channels are not proportional.

    Proportional means v_c = f_c · v_r within `TOLERANCE` at every sample, r being the channel of the
    largest value that is met first; samples of 0 in every channel agree with any factors.  The factors are
    at most 1, and a single one where they are all the same.  Reads the grid slab by slab, up to the first
    sample that disagrees; the new grid is a copy of one channel.

    Parameters
    ----------
    grid : values finite and at least 0, of three channels.
    """
    values = grid.values.reshape(-1, grid.values.shape[-1])
    slabs = [values[first : first + SLAB // 8] for first in range(0, len(values), SLAB // 8)]
    reference, factors = 0, None
    for slab in slabs:
        if factors is None:
            largest = slab[slab.max(axis=1).argmax()].astype(np.float64)
            if not largest.any():
                continue
            reference = int(largest.argmax())
            factors = largest / largest[reference]
        expected = slab[:, reference, None] * factors
        if (np.abs(slab - expected) > TOLERANCE * expected).any():
            return None
    if factors is None or (factors >= 1.0 - TOLERANCE).all():
        factors = np.ones(1)
    one = np.ascontiguousarray(grid.values[..., reference : reference + 1])
    return replace(grid, values=one), tuple(factors.tolist())
