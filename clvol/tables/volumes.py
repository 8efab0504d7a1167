"""Grid volumes as brick maps, and their place in the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.accel.bounds import classified
from clvol.tables.affine import from_centred
from clvol.volumes.bricks import BrickMap, BrickTree, build_bricks
from clvol.volumes.grid import DenseGrid

if TYPE_CHECKING:
    from clvol.scene import records
    from clvol.tables.wrapped import Reach
    from clvol.volumes.transfer import Transfer


@dataclass(frozen=True, eq=False)
class PreparedVolume:
    """A grid volume as bricks, with the map from the scene's centred world to brick index space.

    `reach` : the samples that the bricks have, where it repeats or mirrors beyond its box in a medium.
    """

    volume: records.GridVolume
    bricks: BrickMap | BrickTree
    world_to_index: np.ndarray
    reach: Reach | None = None

    def peak(self, transfer: Transfer | None) -> np.ndarray:
        """The largest value of each channel, or of what is made of the values; float64 (channels,)."""
        if transfer is None:
            return self.bricks.peak.astype(np.float64)
        lowest, highest = self.bricks.minimum.min(initial=np.inf), self.bricks.maximum.max(initial=-np.inf)
        constants = self.bricks.constants
        lowest = min(float(lowest), float(constants.min(initial=np.inf)))
        highest = max(float(highest), float(constants.max(initial=-np.inf)))
        _, peak = classified(np.array([lowest], np.float32), np.array([highest], np.float32), transfer)
        return peak.astype(np.float64)

    def middles(self, transfer: Transfer | None) -> np.ndarray:
        """Halfway between the extrema of each cube of 4³ cells, or of what is made of them.

        float64 (..., channels); of a tree, in the bricks that it keeps.
        """
        low, high = self.bricks.minimum, self.bricks.maximum
        if transfer is not None:
            low, high = classified(low, high, transfer)
        middles: np.ndarray = 0.5 * (low.astype(np.float64) + high)
        return middles

    @property
    def edges(self) -> np.ndarray:
        """A voxel's edges in the world, the columns of a float64 (3, 3)."""
        return np.linalg.inv(self.world_to_index)[:3, :3]

    @property
    def voxel(self) -> np.ndarray:
        """World lengths of a voxel's edges, float64 (3,)."""
        lengths: np.ndarray = np.linalg.norm(self.edges, axis=0)
        return lengths


def prepare_volume(
    volume: records.GridVolume,
    centre: np.ndarray,
    bricks: BrickMap | BrickTree | None = None,
    reach: Reach | None = None,
) -> PreparedVolume:
    """Build a volume's bricks, or take those of its grid; `centre`: the world position that is the origin.

    `reach` : the samples that its medium can ask it for, of a volume that wraps beyond its box.
    """
    grid, first = volume.grid, -first_sample(volume) if reach is None else np.array(reach.first, float)
    if bricks is None and isinstance(grid, DenseGrid):
        if reach is not None:
            grid = replace(grid, values=reach.of(grid.values, volume.wrap_mode))
        elif first.any():
            wrapped = np.pad(grid.values, [(1, 1), (1, 1), (1, 1), (0, 0)], mode="wrap")
            grid = replace(grid, values=wrapped)
    bricks = bricks or build_bricks(grid)
    to_brick = np.eye(4)
    to_brick[:3, 3] = -(np.array(bricks.origin) + first)
    return PreparedVolume(volume, bricks, to_brick @ from_centred(volume.index_to_world, centre), reach)


def first_sample(volume: records.GridVolume) -> np.ndarray:
    """Where a volume's bricks have its first sample, float64 (3,): dense ones that repeat begin before it."""
    return np.full(3, float(volume.wrap_mode == "repeat" and isinstance(volume.grid, DenseGrid)))
