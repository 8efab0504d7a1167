"""Fields over the world, that media and textures look up: plain frozen records, as in `records`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from clvol.volumes.grid import Grid


@dataclass(frozen=True, eq=False)
class ConstVolume:
    """The same value at every point of the unit cube under `to_world` (4x4, local to world)."""

    value: tuple[float, ...]
    to_world: np.ndarray = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False)
class GridVolume:
    """A sampled field in the world.

    `index_to_world` (4x4) maps the grid's index space, where sample (i, j, k) sits at the point
    (i, j, k), to the world.  The field is defined on the index-space box `lower`..`upper`
    (float64 (3,), x y z); for a cell-centred gridvolume that is -½ .. n-½.
    """

    grid: Grid
    index_to_world: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    filter_type: str = "trilinear"  # "trilinear" | "nearest"
    wrap_mode: str = "clamp"  # "clamp" | "repeat" | "mirror": values outside lower..upper
    clipped: bool = True  # False: a vdb whose background is not 0 reaches beyond its box
    source: str = ""  # file and grid, for messages
    sanitize: bool = False  # NaN and slightly negative samples are to be 0
    repairs: str = ""  # how many of them were


Volume = ConstVolume | GridVolume
