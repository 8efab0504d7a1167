"""Empty space in a grid of bounds, marked so that walks cross much of it in one step."""

from __future__ import annotations

import numpy as np

SKIP_LEVELS = 3
"""Blocks of 2, 4 and 8 cells an axis are marked where they are empty."""


def marked_empty(majorant: np.ndarray) -> np.ndarray:
    """Bounds of a grid's cells, with -n in place of 0 where the aligned block of n cells an axis is empty.

    majorant : float32 (nz, ny, nx), not negative.  Blocks may end beyond the grid, whose outermost cells
        reach out to infinity.
    """
    marked = majorant.copy()
    empty = majorant == 0
    for level in range(1, SKIP_LEVELS + 1):
        edge = 1 << level
        padded = np.pad(empty, [(0, -size % edge) for size in empty.shape], constant_values=True)
        nz, ny, nx = (size // edge for size in padded.shape)
        blocks = padded.reshape(nz, edge, ny, edge, nx, edge).all(axis=(1, 3, 5))
        of_cells = blocks.repeat(edge, 0).repeat(edge, 1).repeat(edge, 2)
        marked[of_cells[tuple(slice(size) for size in empty.shape)]] = -edge
    return marked
