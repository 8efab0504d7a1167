"""Bricks: 8³ cells of 9³ samples, the bounds and means of its halves, its samples in sparse grids."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.base.types import triple
from clvol.layout import BRICK_CELLS, BRICK_EDGE, BRICK_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.grid import SparseGrid
    from clvol.volumes.sparse_places import SparsePlaces

BOUND_CELLS = 4
"""Edge, in grid cells, of the finest extrema that are kept: half a brick."""
CHUNK_BRICKS = 4096


def half_extrema(samples: np.ndarray, axis: int, combine: np.ufunc) -> np.ndarray:
    """Extrema over runs of BOUND_CELLS cells, both end samples included, along one axis."""
    count = (samples.shape[axis] - 1) // BOUND_CELLS
    shape = samples.shape
    inner = [slice(None)] * samples.ndim
    inner[axis] = slice(0, count * BOUND_CELLS)
    blocks = samples[tuple(inner)].reshape(*shape[:axis], count, BOUND_CELLS, *shape[axis + 1 :])
    ends = [slice(None)] * samples.ndim
    ends[axis] = slice(BOUND_CELLS, None, BOUND_CELLS)
    extrema: np.ndarray = combine(combine.reduce(blocks, axis=axis + 1), samples[tuple(ends)])
    return extrema


def half_means(samples: np.ndarray) -> np.ndarray:
    """Means over the half bricks of bricks: (n, 9, 9, 9, channels) to float64 (n, 2, 2, 2, channels)."""
    trapezoid = np.zeros((2, BRICK_EDGE))
    for half, first in enumerate((0, BOUND_CELLS)):
        trapezoid[half, first : first + BOUND_CELLS + 1] = 1 / BOUND_CELLS
        trapezoid[half, [first, first + BOUND_CELLS]] /= 2
    weights = np.einsum("az,by,cx->zyxabc", trapezoid, trapezoid, trapezoid).reshape(BRICK_SAMPLES, 8)
    count, channels = len(samples), samples.shape[-1]
    by_channel = np.moveaxis(samples, -1, 1).reshape(count * channels, BRICK_SAMPLES)
    means = by_channel.astype(np.float64) @ weights
    return np.moveaxis(means.reshape(count, channels, 2, 2, 2), 1, -1)


def sparse_lattice(grid: SparseGrid) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Samples per axis and index of the first sample, x, y, z.

    The active box and one voxel all round, its start moved down to a leaf's.
    """
    box = grid.active_box.astype(np.int64)
    lower = (box[0] - 1) // BRICK_CELLS * BRICK_CELLS
    return triple(box[1] + 2 - lower), triple(lower)


def bricks_over(size: tuple[int, int, int]) -> tuple[int, int, int]:
    """Bricks per axis, z, y, x, over a lattice of `size` samples x, y, z."""
    return triple(-(-(n - 1) // BRICK_CELLS) for n in size[::-1])


def gather_sparse(grid: SparseGrid, standing: SparsePlaces, places: np.ndarray) -> Iterator[np.ndarray]:
    """Samples of bricks, a chunk at a time: (n, 9, 9, 9, channels), far faces from the neighbours.

    places : int (n, 3), z y x.
    """
    for first in range(0, len(places), CHUNK_BRICKS):
        chunk = places[first : first + CHUNK_BRICKS]
        samples = np.empty((len(chunk), BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, grid.channels), np.float32)
        for corner in np.ndindex(2, 2, 2):
            source = tuple(slice(0, 1) if d else slice(0, 8) for d in corner)
            target = tuple(slice(8, 9) if d else slice(0, 8) for d in corner)
            at = chunk + np.array(corner)
            leaf = standing.leaf(at)
            block = np.empty((len(chunk), *(s.stop for s in source), grid.channels), np.float32)
            block[:] = standing.constant(at)[:, None, None, None]
            filled = leaf >= 0
            block[filled] = grid.leaf_values[leaf[filled]][:, *source]
            samples[:, *target] = block
        yield samples


def sparse_extrema(
    grid: SparseGrid, standing: SparsePlaces, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Extrema of the halves of bricks: two arrays (n, 2, 2, 2, channels)."""
    low = np.empty((len(places), 2, 2, 2, grid.channels), np.float32)
    high, first = np.empty_like(low), 0
    for samples in gather_sparse(grid, standing, places):
        for combine, target in ((np.minimum, low), (np.maximum, high)):
            halves = samples
            for axis in (1, 2, 3):
                halves = half_extrema(halves, axis, combine)
            target[first : first + len(samples)] = halves
        first += len(samples)
    return low, high
