"""A grid in few cells: the means of blocks of samples, which keep what a ray integrates."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from clvol.volumes.grid import DenseGrid, Grid, SparseGrid

CELLS = 96
"""Most cells along an axis."""
NOTHING = 0.01
"""Share of the densest cell below which a cell shows nothing."""
DIRECTIONS = 256


@dataclass(frozen=True, eq=False)
class Coarse:
    """Means of blocks of `block`³ samples, the first of which is sample `origin` (x, y, z).

    `values`: float32 [z, y, x], the mean over the channels; `outside`: what there is beyond them, None where
    the outermost go on.
    """

    values: np.ndarray
    origin: np.ndarray
    block: int
    outside: float | None = None

    def at(self, index: np.ndarray) -> np.ndarray:
        """Values at index positions (n, 3) x, y, z; float32 (n,)."""
        from scipy.ndimage import map_coordinates  # its import is a fifth of a small picture's whole time

        cells = (index - self.origin + 0.5) / self.block - 0.5
        mode, outside = ("nearest", 0.0) if self.outside is None else ("grid-constant", self.outside)
        found: np.ndarray = map_coordinates(self.values, cells[:, ::-1].T, order=1, mode=mode, cval=outside)
        return found

    def filled(self) -> np.ndarray:
        """Index positions (n, 3): the corners of cells that hold more than `NOTHING`; of all if none does.

        Of each row of cells the first and the last.
        """
        used = self.values > NOTHING * self.values.max()
        if not used.any():
            used[...] = True
        z, y = np.nonzero(used.any(axis=2))
        rows = used[z, y]
        first, last = rows.argmax(axis=1), rows.shape[1] - rows[:, ::-1].argmax(axis=1)
        ends = [
            np.stack([x, y + dy, z + dz], axis=1)
            for x in (first, last)
            for dy, dz in product((0, 1), repeat=2)
        ]
        corners: np.ndarray = np.concatenate(ends) * self.block + self.origin - 0.5
        return corners


def extremes(points: np.ndarray) -> np.ndarray:
    """Those of the points (n, 3) that are farthest in some of `DIRECTIONS` directions, evenly spread."""
    number = np.arange(DIRECTIONS) + 0.5
    z, turn = 1 - 2 * number / DIRECTIONS, np.pi * (1 + np.sqrt(5)) * number
    level = np.sqrt(1 - z**2)
    directions = np.stack([level * np.cos(turn), level * np.sin(turn), z])
    directions = np.concatenate([directions, np.eye(3), -np.eye(3)], axis=1)
    found: np.ndarray = points[np.unique(((points - points.mean(axis=0)) @ directions).argmax(axis=0))]
    return found


def coarse(grid: Grid) -> Coarse:
    """The grid in at most `CELLS` cells along each axis; means beyond float32 are infinite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _of_dense(grid) if isinstance(grid, DenseGrid) else _of_sparse(grid)


def _block(size: np.ndarray) -> int:
    block = 1
    while (size > CELLS * block).any():
        block *= 2
    return block


def _of_dense(grid: DenseGrid) -> Coarse:
    means = grid.values.mean(axis=3, dtype=np.float32)
    block = _block(np.array(means.shape))
    for axis in range(3):
        first = np.arange(0, means.shape[axis], block)
        counts = np.diff(np.append(first, means.shape[axis])).astype(np.float32)
        sums = np.add.reduceat(means, first, axis=axis)
        means = sums / counts.reshape([-1 if n == axis else 1 for n in range(3)])
    return Coarse(means, np.zeros(3), block)


def _of_sparse(grid: SparseGrid) -> Coarse:
    lower, upper = grid.active_box.astype(np.int64)
    origin = lower // 8 * 8
    block = _block(upper + 1 - origin)
    shape = -(-(upper + 1 - origin) // block)
    outside = float(np.mean(grid.background))
    values = np.full(shape[::-1], outside, np.float32)
    _add_tiles(values, grid, origin, block, outside)
    side = min(block, 8)
    count = 8 // side
    blocks = grid.leaf_values.reshape(-1, count, side, count, side, count, side, grid.channels)
    means = blocks.mean(axis=(2, 4, 6, 7), dtype=np.float32) - outside
    steps = np.arange(count)
    z, y, x = np.meshgrid(steps, steps, steps, indexing="ij")
    first = (grid.leaf_origins.astype(np.int64) - origin) // block
    cells = first[:, None, None, None] + np.stack([x, y, z], axis=-1)
    _add(values, cells.reshape(-1, 3), means.reshape(-1) * np.float32((side / block) ** 3))
    return Coarse(values, origin.astype(np.float64), block, outside)


def _add_tiles(values: np.ndarray, grid: SparseGrid, origin: np.ndarray, block: int, outside: float) -> None:
    """Add what the tiles differ from what is outside."""
    excess = grid.tile_values.reshape(-1, grid.channels).mean(axis=1) - outside
    small = grid.tile_sizes <= block
    first = (grid.tile_origins.astype(np.int64) - origin) // block
    last = first + grid.tile_sizes[:, None] // block
    for low, high, value in zip(first[~small], last[~small], excess[~small], strict=True):
        (x0, y0, z0), (x1, y1, z1) = np.maximum(low, 0), np.maximum(high, 0)
        values[z0:z1, y0:y1, x0:x1] += value
    _add(values, first[small], excess[small] * (grid.tile_sizes[small] / block).astype(np.float32) ** 3)


def _add(values: np.ndarray, cells: np.ndarray, what: np.ndarray) -> None:
    """Add to those of the cells (n, 3) x, y, z that there are."""
    inside = ((cells >= 0) & (cells < values.shape[::-1])).all(axis=-1)
    x, y, z = cells[inside].T
    np.add.at(values, (z, y, x), what[inside])
