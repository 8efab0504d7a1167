"""Samples that cannot be coefficients made 0, where a user asks for it, and counted."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from clvol.volumes.check import SLIGHT, greatest, slabs
from clvol.volumes.files import place
from clvol.volumes.grid import DenseGrid, Grid

log = logging.getLogger("clvol")


@dataclass(frozen=True)
class Repairs:
    """How many samples were made 0: those that were NaN, and those that were slightly negative."""

    nan: int = 0
    negative: int = 0

    def __bool__(self) -> bool:
        return bool(self.nan or self.negative)

    def __str__(self) -> str:
        counts = ((self.nan, "NaN"), (self.negative, "slightly negative"))
        return " and ".join(f"{count} {what}" for count, what in counts if count)


def sanitized(grid: Grid, signed: bool = False) -> tuple[Grid, Repairs]:
    """The grid with NaN and slightly negative samples as 0, and how many they were.

    Slightly negative is what resampling and compression leave: down to -SLIGHT times the greatest sample.
    Anything else stays, for the checks to refuse: infinity, and what is more negative.

    Parameters
    ----------
    grid : is not changed; it is returned as it is where there is nothing to repair.
    signed : negative samples have a meaning, as those of temperatures, and stay.
    """
    lowest = 0.0 if signed else -SLIGHT * greatest(grid)
    counted = Repairs()
    for slab in slabs(grid):
        counted = Repairs(
            counted.nan + int(np.count_nonzero(np.isnan(slab))),
            counted.negative + int(np.count_nonzero((slab < 0) & (slab >= lowest))),
        )
    if not counted:
        return grid, counted
    names = ("values",) if isinstance(grid, DenseGrid) else ("leaf_values", "tile_values", "background")
    mended = replace(grid, **{name: getattr(grid, name).copy() for name in names})
    for slab in slabs(mended):
        slab[np.isnan(slab) | ((slab < 0) & (slab >= lowest))] = 0
    if isinstance(mended, DenseGrid):
        mended.values.flags.writeable = False
    return mended, counted


def warn_of(grid: Grid, repairs: Repairs) -> None:
    """Say in the log how many samples of a grid are taken as 0, if any are."""
    if repairs:
        log.warning("%s: %s samples are taken as 0", place(grid.source, grid.name), repairs)
