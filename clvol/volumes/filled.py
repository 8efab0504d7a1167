"""Sparse grids as dense arrays, for formats that have no other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.volumes.files import allocate, place

if TYPE_CHECKING:
    from clvol.volumes.grid import SparseGrid


def filled(grid: SparseGrid) -> tuple[np.ndarray, np.ndarray]:
    """All samples of the active box and one round it, and the index position of the first.

    Returns
    -------
    values : float32 [z, y, x, channel].
    lower : int64 (3,), x y z.

    Raises VolumeError where they are more than fits.
    """
    lower = grid.active_box[0].astype(np.int64) - 1
    shape = (grid.active_box[1].astype(np.int64) + 2 - lower)[::-1]
    values = allocate((*map(int, shape), grid.channels), np.float32, place(grid.source, grid.name))
    values[...] = grid.background
    tiles = zip(grid.tile_origins, grid.tile_sizes, grid.tile_values, strict=True)
    leaves = ((at, 8, samples) for at, samples in zip(grid.leaf_origins, grid.leaf_values, strict=True))
    for origin, edge, samples in (*tiles, *leaves):
        first = origin.astype(np.int64) - lower
        start, end = np.maximum(first, 0), np.minimum(first + edge, shape[::-1])
        if (end <= start).any():
            continue
        to = tuple(slice(a, b) for a, b in zip(start[::-1], end[::-1], strict=True))
        own = tuple(slice(a, b) for a, b in zip((start - first)[::-1], (end - first)[::-1], strict=True))
        values[to] = samples[own] if samples.ndim > 1 else samples
    return values, lower
