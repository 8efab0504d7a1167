"""Bounds of a field over the cells of a lattice: the raw material of every majorant.

Arrays are indexed [z, y, x, channel].  A cell's bounds hold for every interpolated value in the closed
cell, and, by the slack below, for look-ups that rounding puts just outside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.transfer import Transfer

SLACK = np.float32(2.0**-10)
"""A float position on a ray may lie this fraction of a voxel beyond the cell it was computed for, in lattices
of up to SLACK_SIZE voxels an axis; the fraction grows with their size."""
SLACK_SIZE = 4096
_VALUE_ROUNDING = 2.0**-20
"""Share of the largest magnitude by which the interpolation of values of any sign may round."""
_ROUNDING = np.float32(1 + 2.0**-20)
"""Interpolation rounds: its result may exceed its largest input by a few units in the last place."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """Extrema, and where they are wanted means, per cell and channel: float32 (nz, ny, nx, channels).

    cell_size : the cell's edge in index units.
    """

    minimum: np.ndarray
    maximum: np.ndarray
    cell_size: float
    mean: np.ndarray | None = None

    @property
    def cells(self) -> tuple[int, int, int]:
        """Cells per axis, x y z."""
        nz, ny, nx = self.maximum.shape[:3]
        return nx, ny, nz

    @property
    def majorant(self) -> np.ndarray:
        """The one bound that all channels share, (nz, ny, nx)."""
        return over_channels(self.maximum, np.maximum)

    def groups(self) -> Iterator[tuple[Bounds, list[float]]]:
        """All cells, and their sides in cells of the lattice: all alike (cf. clvol.accel.sparse_bounds)."""
        yield self, [1.0, 1.0, 1.0]

    def coarser(self) -> Bounds:
        """The same over cells of twice the edge; in a mean every cell that it merges counts the same."""
        mean = None if self.mean is None else _merged_mean(self.mean)
        low, high = _merge(self.minimum, np.minimum), _merge(self.maximum, np.maximum)
        return Bounds(low, high, 2 * self.cell_size, mean)

    def whole(self) -> Bounds:
        """The same over a single cell that holds all."""
        low, high = self.minimum.min(axis=(0, 1, 2)), self.maximum.max(axis=(0, 1, 2))
        mean = None
        if self.mean is not None:
            mean = self.mean.mean(axis=(0, 1, 2), dtype=np.float64).astype(np.float32)[None, None, None]
        return Bounds(low[None, None, None], high[None, None, None], max(self.cells) * self.cell_size, mean)


def over_channels(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    """Channels combined into one number, (..., channels) to (...); a view where there is but one."""
    return reduce(combine, np.moveaxis(values, -1, 0))


def _merge(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    for axis in range(3):
        starts = np.arange(0, values.shape[axis], 2)
        values = combine.reduceat(values, starts, axis=axis)
    return values


def _merged_mean(values: np.ndarray) -> np.ndarray:
    ones = np.ones((*values.shape[:3], 1), np.float64)
    means: np.ndarray = _merge(values.astype(np.float64), np.add) / _merge(ones, np.add)
    return means.astype(np.float32)


def with_slack(
    minimum: np.ndarray,
    maximum: np.ndarray,
    cell_size: float,
    mean: np.ndarray | None = None,
    transfer: Transfer | None = None,
) -> Bounds:
    """Bounds that also hold `SLACK` of a voxel beyond each cell, and after rounding; `mean` as it is.

    transfer : what is made of the interpolated values whose extrema are given, and then bounded.

    The field changes by at most (neighbour's extremum - own) over one voxel into the neighbour.
    A cell that is exactly 0 in every channel stays 0, so that empty space is skipped.
    """
    around = _neighbourhood(minimum, np.minimum), _neighbourhood(maximum, np.maximum)
    size = max(minimum.shape[:3]) * cell_size
    return Bounds(*slackened(minimum, maximum, *around, size, transfer), cell_size, mean)


def slackened(
    minimum: np.ndarray,
    maximum: np.ndarray,
    least: np.ndarray,
    most: np.ndarray,
    size: float,
    transfer: Transfer | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Extrema (..., channels) with slack; `least`, `most` are over neighbours too; `size`: in voxels."""
    slack = SLACK * np.float32(max(1.0, size / SLACK_SIZE))
    high = maximum + slack * (most - maximum)
    low = minimum + slack * (least - minimum)
    if transfer is not None:
        holds_matter = transfer.extrema(minimum, maximum)[1] > 0
        least, bound = classified(low, high, transfer)
        return np.where(holds_matter, least, 0), np.where(holds_matter, bound, 0)
    holds_matter = over_channels(maximum, np.maximum)[..., None] > 0
    high = np.where(holds_matter, high * _ROUNDING, np.float32(0)).astype(np.float32)
    return np.maximum(low / _ROUNDING, np.float32(0)).astype(np.float32), high


def classified(low: np.ndarray, high: np.ndarray, transfer: Transfer) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of what a transfer function makes of values in [low, high], as devices compute it: float32.

    Interpolating samples that differ rounds, and so does the function, by some of its largest value.  What is
    exactly 0 over the whole range stays 0, so that empty space is skipped.
    """
    reach = np.where(high > low, np.maximum(np.abs(low), np.abs(high)) * _VALUE_ROUNDING, 0)
    least, most = transfer.extrema(low.astype(np.float64) - reach, high.astype(np.float64) + reach)
    rounding = _VALUE_ROUNDING * transfer.largest
    bound = np.where(most > 0, most * float(_ROUNDING) + rounding, 0)
    return np.maximum(least / float(_ROUNDING) - rounding, 0).astype(np.float32), bound.astype(np.float32)


def _neighbourhood(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    """Extremum over each cell and its 26 neighbours."""
    for axis in range(3):
        wide = np.pad(values, [(1, 1) if a == axis else (0, 0) for a in range(values.ndim)], mode="edge")
        n = values.shape[axis]
        parts = [np.take(wide, range(k, k + n), axis=axis) for k in range(3)]
        values = combine(combine(parts[0], parts[1]), parts[2])
    return values
