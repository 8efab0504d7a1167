"""Whether samples can be coefficients or temperatures of a medium: finite, not negative, there at all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import VolumeError, parameter
from clvol.volumes.files import place
from clvol.volumes.grid import LEVEL_SET, DenseGrid, Grid
from clvol.volumes.narrowing import SMALLEST, vanishing

if TYPE_CHECKING:
    from collections.abc import Iterator

# Samples looked at together: the largest temporary is one mask of them.
SLAB = 1 << 22
SLIGHT = 0.1
"""Negative samples down to so much of the greatest are slight: resampling with sharp filters leaves them."""


def check_coefficients(grid: Grid, what: str = "density", mendable: bool = True) -> None:
    """Raise VolumeError unless every sample is finite and ≥ 0 and there is at least one.

    Parameters
    ----------
    grid : dense, or sparse with at least one active voxel; of a sparse one every voxel of the
        leaves (interpolation reads inactive ones too), the tiles and the background are checked.
    what : the coefficient the samples are used for, as the message names it.
    mendable : whoever gives them can ask for `clvol.volumes.repair.sanitized`.
    """
    _check(grid, what, False, mendable)


def check_finite(grid: Grid, what: str, mendable: bool = True) -> None:
    """As `check_coefficients`, but samples may be negative, as temperatures may."""
    _check(grid, what, True, mendable)


def _check(grid: Grid, what: str, signed: bool, mendable: bool) -> None:
    where = place(grid.source, grid.name)
    if isinstance(grid, DenseGrid):
        if grid.values.size == 0:
            raise VolumeError(f"{what} has no samples", where)
    elif grid.active_voxels == 0:
        raise VolumeError(f"{what} has no active voxels", where, "choose another grid or file")
    elif grid.kind == LEVEL_SET:
        raise VolumeError(
            f"{what} is a level set: distances to a surface, not amounts of something",
            where,
            f"make a fog volume of it: {parameter('level_set', 'fog')}",
        )
    total = broken = negative = 0
    lowest = highest = 0.0
    for slab in slabs(grid):
        total += slab.size
        low, high = slab.min(), slab.max()
        highest = max(highest, float(high))  # NaN stays out
        if (np.isfinite(low) if signed else low >= 0) and np.isfinite(high):
            continue
        broken += slab.size - int(np.count_nonzero(np.isfinite(slab)))
        if signed:
            continue
        below = (slab < 0) & np.isfinite(slab)
        negative += int(np.count_nonzero(below))
        lowest = min(lowest, float(slab.min(where=below, initial=0.0)))
    if not broken and 0 < highest < SMALLEST and not negative:
        raise vanishing(highest, where)
    faults = []
    if broken:
        faults.append(f"{broken} NaN or infinite")
    if negative:
        faults.append(f"{negative} negative (minimum {lowest:.6g})")
    if faults:
        raise VolumeError(
            f"{what} has {' and '.join(faults)} of {total} samples",
            where,
            f"samples must be finite{'' if signed else ' and at least 0'}: repair or clamp the data"
            f"{_sanitize(grid, lowest, signed) if mendable else ''}",
        )


def _sanitize(grid: Grid, lowest: float, signed: bool) -> str:
    """The advice to take all that is wrong as 0, where `clvol.volumes.repair.sanitized` does; else ""."""
    infinite = any(np.isinf(slab).any() for slab in slabs(grid))
    low = not signed and lowest < -SLIGHT * greatest(grid)
    return "" if infinite or low else f", or take them as 0: {parameter('sanitize', True)}"


def greatest(grid: Grid) -> float:
    """The greatest finite sample, at least 0."""
    return max(float(slab.max(where=np.isfinite(slab), initial=0.0)) for slab in slabs(grid))


def slabs(grid: Grid) -> Iterator[np.ndarray]:
    """Every stored sample, in flat views of at most SLAB."""
    if isinstance(grid, DenseGrid):
        stores = [grid.values]
    else:
        stores = [grid.leaf_values, grid.tile_values, grid.background]
    for store in stores:
        flat = store.reshape(-1)
        for first in range(0, flat.size, SLAB):
            yield flat[first : first + SLAB]
