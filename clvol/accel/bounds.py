"""Bounds of a field over the cells of a lattice: the raw material of every majorant.

Arrays are indexed [z, y, x].  A cell's bounds hold for every interpolated value in the closed cell,
and, by the slack below, for look-ups that rounding puts just outside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SLACK = np.float32(2.0**-10)
"""A float position on a ray may lie this fraction of a voxel beyond the cell it was computed for."""
_ROUNDING = np.float32(1 + 2.0**-20)
"""Interpolation rounds: its result may exceed its largest input by a few units in the last place."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """Extrema per cell, float32 (nz, ny, nx), and the cell's edge in index units."""

    minimum: np.ndarray
    maximum: np.ndarray
    cell_size: float

    @property
    def cells(self) -> tuple[int, int, int]:
        """Cells per axis, x y z."""
        nz, ny, nx = self.maximum.shape
        return nx, ny, nz

    def coarser(self) -> Bounds:
        """The same bounds over cells of twice the edge."""
        return Bounds(_merge(self.minimum, np.minimum), _merge(self.maximum, np.maximum), 2 * self.cell_size)


def _merge(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    for axis in range(3):
        starts = np.arange(0, values.shape[axis], 2)
        values = combine.reduceat(values, starts, axis=axis)
    return values


def with_slack(minimum: np.ndarray, maximum: np.ndarray, cell_size: float) -> Bounds:
    """Bounds that also hold `SLACK` of a voxel beyond each cell, and after rounding.

    The field changes by at most (neighbour's extremum - own) over one voxel into the neighbour.
    A cell that is exactly 0 stays 0, so that empty space is skipped.
    """
    high = maximum + SLACK * (_neighbourhood(maximum, np.maximum) - maximum)
    low = minimum + SLACK * (_neighbourhood(minimum, np.minimum) - minimum)
    high = np.where(maximum > 0, high * _ROUNDING, np.float32(0)).astype(np.float32)
    low = np.maximum(low / _ROUNDING, np.float32(0)).astype(np.float32)
    return Bounds(low, high, cell_size)


def _neighbourhood(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    """Extremum over each cell and its 26 neighbours."""
    for axis in range(3):
        wide = np.pad(values, [(1, 1) if a == axis else (0, 0) for a in range(3)], mode="edge")
        n = values.shape[axis]
        parts = [np.take(wide, range(k, k + n), axis=axis) for k in range(3)]
        values = combine(combine(parts[0], parts[1]), parts[2])
    return values
