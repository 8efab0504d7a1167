"""Looks samples up in grids, for tests."""

from __future__ import annotations

import numpy as np

from clvol.volumes.grid import SparseGrid


def samples_in_box(grid: SparseGrid, lower, upper) -> np.ndarray:
    """Samples of an inclusive index box as float32, indexed [x, y, z]."""
    lower = np.asarray(lower)
    shape = np.asarray(upper) - lower + 1
    out = np.full(shape, grid.background, np.float32)
    tiles = zip(grid.tile_origins, grid.tile_sizes, grid.tile_values, strict=True)
    leaves = ((o, 8, v.transpose(2, 1, 0)) for o, v in zip(grid.leaf_origins, grid.leaf_values, strict=True))
    for origin, size, values in [*tiles, *leaves]:
        first, last = np.maximum(origin, lower), np.minimum(origin + size, lower + shape)
        if (first < last).all():
            target = tuple(slice(a, b) for a, b in zip(first - lower, last - lower, strict=True))
            source = tuple(slice(a, b) for a, b in zip(first - origin, last - origin, strict=True))
            out[target] = values[source] if np.ndim(values) else values
    return out


def active_samples(grid: SparseGrid) -> tuple[np.ndarray, np.ndarray]:
    """Values of the active samples and how many samples each stands for (512 or more for tiles)."""
    bits = np.unpackbits(grid.leaf_active, axis=1, bitorder="little").view(bool)
    voxels = grid.leaf_values.transpose(0, 3, 2, 1).reshape(-1, 512)[bits]
    tiles = grid.tile_values[grid.tile_active]
    sizes = grid.tile_sizes[grid.tile_active].astype(np.int64) ** 3
    return np.concatenate([voxels, tiles]), np.concatenate([np.ones(len(voxels), np.int64), sizes])
