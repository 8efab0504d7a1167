"""Sampled fields on the host, as read from files: dense arrays or sparse 8³ leaves.

Both put sample (i, j, k) at the integer index position (i, j, k), x first; where those positions
lie in the world is the business of the volume that uses the grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FOG_VOLUME, LEVEL_SET, STAGGERED = "fog volume", "level set", "staggered"
KINDS = (FOG_VOLUME, LEVEL_SET, STAGGERED)
"""OpenVDB's grid classes: densities, signed distances to a surface, velocities at the faces of voxels."""


@dataclass(frozen=True, eq=False)
class DenseGrid:
    """Samples on a full lattice.

    `values` is float32 (nz, ny, nx, channels), C order, read-only; sample (i, j, k) is
    ``values[k, j, i]``.  `box` is the file's own bounding box, float64
    (2, 3) in x, y, z order (the unit cube where a format has none).

    `index_to_world`, float64 (4, 4) for column vectors, is the file's own transform, and `unit` that of its
    positions, as "mm"; None of files and arrays that say nothing of where their samples lie.
    """

    values: np.ndarray
    box: np.ndarray
    name: str = ""
    source: str = ""
    index_to_world: np.ndarray | None = None
    unit: str = ""

    @property
    def channels(self) -> int:
        """Values of a sample: 1 or 3."""
        return int(self.values.shape[-1])

    def __repr__(self) -> str:
        depth, height, width, channels = self.values.shape
        return f"<DenseGrid {self.name or self.source}: {width} x {height} x {depth}, {channels} channels>"


@dataclass(frozen=True, eq=False)
class SparseGrid:
    """Samples of an OpenVDB tree: 8³ leaves and constant tiles over a background, of 1 or 3 channels.

    leaf_origins : int32 (n, 3), x y z index of each leaf's first sample, multiples of 8.
    leaf_values : float32 (n, 8, 8, 8, channels), indexed [leaf, z, y, x]; inactive voxels hold their stored
        value.
    leaf_active : uint8 (n, 64), bit mask of active voxels, bit order as in OpenVDB (x slowest).
    tile_origins : int32 (m, 3); tile_sizes : int32 (m,), edge in samples, a multiple of 8.
    tile_values : float32 (m, channels); tile_active : bool (m,).
    background : float32 (channels,), the value everywhere else.
    index_to_world : float64 (4, 4) for column vectors: the grid's own transform.
    active_box : int32 (2, 3), inclusive lower and upper index of the active samples (tiles included).
    kind : what the file says that the values are, one of KINDS, or "" where it does not say.
    """

    leaf_origins: np.ndarray
    leaf_values: np.ndarray
    leaf_active: np.ndarray
    tile_origins: np.ndarray
    tile_sizes: np.ndarray
    tile_values: np.ndarray
    tile_active: np.ndarray
    background: np.ndarray
    index_to_world: np.ndarray
    active_box: np.ndarray
    kind: str = ""
    name: str = "density"
    source: str = ""

    def __repr__(self) -> str:
        return f"<SparseGrid {self.name}: {len(self.leaf_origins)} leaves, {len(self.tile_origins)} tiles>"

    @property
    def channels(self) -> int:
        """Values of a sample: 1 or 3."""
        return int(self.leaf_values.shape[-1])

    @property
    def clear_outside(self) -> bool:
        """Whether there is nothing outside of the leaves and tiles: the background is 0."""
        return not self.background.any()

    @property
    def active_voxels(self) -> int:
        """Number of active samples, those inside active tiles included."""
        in_leaves = int(np.bitwise_count(self.leaf_active).sum(dtype=np.int64))
        in_tiles = int((self.tile_sizes[self.tile_active].astype(np.int64) ** 3).sum())
        return in_leaves + in_tiles


Grid = DenseGrid | SparseGrid
