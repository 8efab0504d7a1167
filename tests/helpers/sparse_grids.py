"""Sparse grids for tests, what they hold as arrays, and media made of them in the unit cube."""

import numpy as np

from clvol.scene.records import ConstVolume, GridVolume, Medium
from clvol.volumes.grid import SparseGrid


def grid_of(origins, values, background=0.0, tiles=()):
    """Leaves (n, 3) x y z with values (n, 8, 8, 8), and tiles (origin, edge, value), all active.

    Of several channels the values are (n, 8, 8, 8, channels), and background and tiles have as many.
    """
    values = np.asarray(values, np.float32)
    background = np.array(background, np.float32).reshape(-1)
    origins = np.asarray(origins, np.int32)
    starts = np.array([tile[0] for tile in tiles], np.int32).reshape(-1, 3)
    edges = np.array([tile[1] for tile in tiles], np.int32)
    lower = np.concatenate([origins, starts]).min(axis=0)
    upper = np.concatenate([origins + 7, starts + edges[:, None] - 1]).max(axis=0)
    return SparseGrid(
        origins,
        values.reshape(*values.shape[:4], -1),
        np.full((len(origins), 64), 255, np.uint8),
        starts,
        edges,
        np.array([tile[2] for tile in tiles], np.float32).reshape(-1, len(background)),
        np.ones(len(tiles), bool),
        background,
        np.eye(4),
        np.array([lower, upper], np.int32),
    )


def lumps(seed=1, places=18, leaves=60, background=0.0, tiles=()):
    """Leaves at random places of a box, some of one value, and tiles that they keep clear of."""
    rng = np.random.default_rng(seed)
    origins = 8 * np.unique(rng.integers(0, places, (leaves, 3)), axis=0)
    for start, edge, _ in tiles:
        origins = origins[~((origins >= start) & (origins < np.array(start) + edge)).all(axis=1)]
    values = rng.random((len(origins), 8, 8, 8)) ** 3
    values[::5] = background
    values[1::5] = 0.7
    return grid_of(origins, values, background, tiles)


def dense_of(grid):
    """All samples of the active box and one voxel round it, [z, y, x], or [z, y, x, channel] of several."""
    lower, upper = grid.active_box[0] - 1, grid.active_box[1] + 1
    values = np.empty((*(upper - lower + 1)[::-1], grid.channels), np.float32)
    values[...] = grid.background
    tiles = zip(grid.tile_origins, grid.tile_sizes, grid.tile_values, strict=True)
    leaves = ((o, 8, v) for o, v in zip(grid.leaf_origins, grid.leaf_values, strict=True))
    for origin, edge, value in [*tiles, *leaves]:
        x, y, z = origin - lower
        values[z : z + edge, y : y + edge, x : x + edge] = value
    return values if grid.channels > 1 else values[..., 0]


def volume_of(grid, filter_type="trilinear", clipped=True):
    """The grid's active box and one voxel round it as the unit cube, as `probe.grid_volume` has an array."""
    lower, upper = grid.active_box[0] - 1.5, grid.active_box[1] + 1.5
    to_world = np.diag([*(1 / (upper - lower)), 1.0])
    to_world[:3, 3] = -lower / (upper - lower)
    return GridVolume(grid, to_world, lower, upper, filter_type, clipped=clipped)


def medium_of_grid(grid, scale=(1.0,), albedo=0.5, **keywords):
    """A medium of the unit cube."""
    return Medium(volume_of(grid), ConstVolume((albedo,)), scale, homogeneous=False, **keywords)
