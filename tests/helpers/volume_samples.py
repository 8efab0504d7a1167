"""Looks samples up in grids, for tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from clvol.volumes.grid import SparseGrid


def samples_in_box(grid: SparseGrid, lower, upper) -> np.ndarray:
    """Samples of an inclusive index box as float32, indexed [x, y, z], or [x, y, z, channel] of several."""
    lower = np.asarray(lower)
    shape = np.asarray(upper) - lower + 1
    out = np.empty((*shape, grid.channels), np.float32)
    out[...] = grid.background
    tiles = zip(grid.tile_origins, grid.tile_sizes, grid.tile_values, strict=True)
    leaf_values = grid.leaf_values.transpose(0, 3, 2, 1, 4)
    leaves = ((o, 8, v) for o, v in zip(grid.leaf_origins, leaf_values, strict=True))
    for origin, size, values in [*tiles, *leaves]:
        first, last = np.maximum(origin, lower), np.minimum(origin + size, lower + shape)
        if (first < last).all():
            target = tuple(slice(a, b) for a, b in zip(first - lower, last - lower, strict=True))
            source = tuple(slice(a, b) for a, b in zip(first - origin, last - origin, strict=True))
            out[target] = values[source] if values.ndim > 1 else values
    return out if grid.channels > 1 else out[..., 0]


def probe(grid: SparseGrid, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values, float32 (n, channels), and whether they are active, of samples at places, int (n, 3) x y z."""
    values = np.empty((len(places), grid.channels), np.float32)
    values[...] = grid.background
    active = np.zeros(len(places), bool)
    for origin, size, value, on in zip(
        grid.tile_origins, grid.tile_sizes, grid.tile_values, grid.tile_active, strict=True
    ):
        inside = ((places >= origin) & (places < origin + size)).all(axis=1)
        values[inside], active[inside] = value, on
    leaves = {tuple(origin): number for number, origin in enumerate(grid.leaf_origins.tolist())}
    found = np.array([leaves.get(tuple(origin), -1) for origin in (places // 8 * 8).tolist()])
    held = np.flatnonzero(found >= 0)
    x, y, z = (places[held] % 8).T
    values[held] = grid.leaf_values[found[held], z, y, x]
    bits = np.unpackbits(grid.leaf_active, axis=1, bitorder="little").reshape(-1, 8, 8, 8)
    active[held] = bits[found[held], x, y, z]
    return values, active


def active_samples(grid: SparseGrid) -> tuple[np.ndarray, np.ndarray]:
    """Values of the active samples and how many samples each stands for (512 or more for tiles)."""
    bits = np.unpackbits(grid.leaf_active, axis=1, bitorder="little").view(bool)
    voxels = grid.leaf_values[..., 0].transpose(0, 3, 2, 1).reshape(-1, 512)[bits]
    tiles = grid.tile_values[grid.tile_active, 0]
    sizes = grid.tile_sizes[grid.tile_active].astype(np.int64) ** 3
    return np.concatenate([voxels, tiles]), np.concatenate([np.ones(len(voxels), np.int64), sizes])
