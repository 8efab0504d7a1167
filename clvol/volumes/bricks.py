"""Brick maps: any grid as 8³-cell bricks of 9³ samples under a top grid, built in bounded memory.

A brick holds the samples of its cells and of their far faces, so that a trilinear look-up never
leaves it, and its extrema bound every interpolated value of the brick (METHODS §5, halo included).
Bricks that are constant are stored once per value.

The top grid is dense over the box: 4 bytes for each brick place of it on the device, and 64 on the host for
the extrema.  Where few places of a large sparse grid hold anything, it is a tree (clvol.volumes.brick_tree).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.types import triple
from clvol.layout import BRICK_CELLS, BRICK_EDGE
from clvol.volumes.brick_samples import (
    BOUND_CELLS,
    bricks_over,
    gather_sparse,
    half_extrema,
    half_means,
    sparse_extrema,
    sparse_lattice,
)
from clvol.volumes.brick_tree import BrickTree, build_tree, check_extent, is_scattered
from clvol.volumes.files import place
from clvol.volumes.grid import DenseGrid, Grid, SparseGrid
from clvol.volumes.sparse_places import SparsePlaces
from clvol.volumes.transfer import made_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.transfer import Transfer

__all__ = ["BOUND_CELLS", "BrickMap", "BrickTree", "build_bricks"]


@dataclass(frozen=True, eq=False)
class BrickMap:
    """A grid ready for the device.

    top : int32 (bz, by, bx), number of the brick at each place.
    brick_count : bricks to store; constants : float32 (n, channels), values of the last n of them.
    minimum, maximum : float32 (2bz, 2by, 2bx, channels), extrema over each cube of 4³ cells, of any
        trilinear, nearest or ½-voxel jittered value in it.
    size : samples per axis x, y, z (at least 2).  origin : grid index (x, y, z) of sample (0, 0, 0).
    """

    grid: Grid
    top: np.ndarray
    brick_count: int
    constants: np.ndarray
    minimum: np.ndarray
    maximum: np.ndarray
    size: tuple[int, int, int]
    origin: tuple[int, int, int]
    channels: int

    levels = 0
    """The top grid is no tree."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Bricks per axis, z y x."""
        return triple(self.top.shape)

    @property
    def peak(self) -> np.ndarray:
        """The largest value of each channel, float32 (channels,)."""
        largest: np.ndarray = self.maximum.max(axis=(0, 1, 2))
        return largest

    def stored(self) -> Iterator[tuple[int, np.ndarray]]:
        """Every brick to store, a bounded chunk at a time: (first brick, float32 (n, 9, 9, 9, channels))."""
        yield from self._varying()
        for number, values in enumerate(self.constants, self.brick_count - len(self.constants)):
            yield (
                number,
                np.broadcast_to(values, (1, BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, self.channels)).copy(),
            )

    def _varying(self) -> Iterator[tuple[int, np.ndarray]]:
        """The same of the bricks that vary, which are numbered in the order of their places."""
        varies = self.top < self.brick_count - len(self.constants)
        if isinstance(self.grid, DenseGrid):
            chunks = _gather_dense(self.grid, varies)
        else:
            standing = SparsePlaces(self.grid, self.origin, self.top.shape)
            chunks = gather_sparse(self.grid, standing, np.argwhere(varies))
        first = 0
        for samples in chunks:
            yield first, samples
            first += len(samples)

    def means(self, transfer: Transfer | None = None) -> np.ndarray:
        """Mean of the trilinear interpolant over each cube of 4³ cells: float32 (2bz, 2by, 2bx, channels).

        Exact, by the trapezoid rule along each axis.  Reads the grid once more, in bounded memory.

        transfer : of what it makes of the values, about: of the samples, interpolated.
        """
        varying = self.brick_count - len(self.constants)
        varies = self.top < varying
        values = np.empty((*self.top.shape, self.channels), np.float32)
        values[~varies] = made_of(self.constants, transfer)[self.top[~varies] - varying]
        means = np.repeat(np.repeat(np.repeat(values, 2, 0), 2, 1), 2, 2)
        places = np.argwhere(varies)
        for first, samples in self._varying():
            halves = half_means(made_of(samples, transfer))
            _put_halves(means, places[first : first + len(samples)], halves)
        return means.clip(self.minimum, self.maximum) if transfer is None else means


def build_bricks(grid: Grid) -> BrickMap | BrickTree:
    """Find which bricks of `grid` vary, number them, and bound them.  Reads the grid once.

    Raises VolumeError where a sparse grid reaches too far (clvol.volumes.brick_tree).
    """
    if isinstance(grid, DenseGrid):
        size, origin = _dense_size(grid), (0, 0, 0)
        return _brick_map(grid, *_extrema_dense(grid), size, origin)
    size, origin = sparse_lattice(grid)
    check_extent(size, place(grid.source, grid.name))
    standing = SparsePlaces(grid, origin, bricks_over(size))
    places = standing.changing()
    if is_scattered(standing.shape, len(places)):
        return build_tree(grid, standing, places)
    return _brick_map(grid, *_extrema_sparse(grid, standing, places), size, origin)


def _brick_map(
    grid: Grid, low: np.ndarray, high: np.ndarray, size: tuple[int, int, int], origin: tuple[int, int, int]
) -> BrickMap:
    brick_low, brick_high = _merge_halves(low, np.minimum), _merge_halves(high, np.maximum)
    varies = (brick_low != brick_high).any(axis=3)
    count = int(np.count_nonzero(varies))
    constants, inverse = np.unique(brick_low[~varies], axis=0, return_inverse=True)
    top = np.empty(varies.shape, np.int32)
    top[varies] = np.arange(count)
    top[~varies] = count + inverse.reshape(-1)
    return BrickMap(grid, top, count + len(constants), constants, low, high, size, origin, low.shape[3])


def _merge_halves(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    """Extrema of bricks from those of their halves: (2n, 2m, 2k, channels) to (n, m, k, channels)."""
    for axis in range(3):
        values = combine(
            np.take(values, range(0, values.shape[axis], 2), axis),
            np.take(values, range(1, values.shape[axis], 2), axis),
        )
    return values


def _put_halves(target: np.ndarray, places: np.ndarray, halves: np.ndarray) -> None:
    """Write values of half bricks, (n, 2, 2, 2, channels), where the bricks at `places` have theirs.

    places : int (n, 3), z y x.
    """
    z, y, x = 2 * places.T
    for dz, dy, dx in np.ndindex(2, 2, 2):
        target[z + dz, y + dy, x + dx] = halves[:, dz, dy, dx]


def _dense_size(grid: DenseGrid) -> tuple[int, int, int]:
    """Samples per axis, x y z, at least 2."""
    return tuple(max(n, 2) for n in grid.values.shape[2::-1])


def _slabs(grid: DenseGrid) -> Iterator[np.ndarray]:
    """The samples of each layer of bricks, float32 (9, 8by + 1, 8bx + 1, channels), borders repeated.

    Each is overwritten by the next.
    """
    bz, by, bx = bricks_over(_dense_size(grid))
    _, ny, nx, channels = grid.values.shape
    slab = np.empty((BRICK_EDGE, by * BRICK_CELLS + 1, bx * BRICK_CELLS + 1, channels), np.float32)
    for z in range(0, bz * BRICK_CELLS, BRICK_CELLS):
        samples = grid.values[z : z + BRICK_EDGE]
        slab[: len(samples), :ny, :nx] = samples
        slab[len(samples) :, :ny, :nx] = samples[-1]
        slab[:, ny:, :nx] = slab[:, ny - 1 : ny, :nx]
        slab[:, :, nx:] = slab[:, :, nx - 1 : nx]
        yield slab


def _extrema_dense(grid: DenseGrid) -> tuple[np.ndarray, np.ndarray]:
    """Extrema of every half brick: two arrays (2bz, 2by, 2bx, channels)."""
    lows, highs = [], []
    for slab in _slabs(grid):
        low = high = slab
        for axis in range(3):
            low, high = half_extrema(low, axis, np.minimum), half_extrema(high, axis, np.maximum)
        lows.append(low)
        highs.append(high)
    return np.concatenate(lows), np.concatenate(highs)


def _gather_dense(grid: DenseGrid, wanted: np.ndarray) -> Iterator[np.ndarray]:
    """Samples of the wanted bricks, layer by layer: (n, 9, 9, 9, channels)."""
    for slab, layer in zip(_slabs(grid), wanted, strict=True):
        if layer.any():
            windows = np.lib.stride_tricks.sliding_window_view(slab, (BRICK_EDGE, BRICK_EDGE), axis=(1, 2))
            windows = windows[:, ::BRICK_CELLS, ::BRICK_CELLS].transpose(1, 2, 0, 4, 5, 3)
            yield np.ascontiguousarray(windows[layer])


def _extrema_sparse(
    grid: SparseGrid, standing: SparsePlaces, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Extrema of every half brick, from their samples at `places`: two arrays (2bz, 2by, 2bx, channels)."""
    bz, by, bx = standing.shape
    low = np.empty((2 * bz, 2 * by, 2 * bx, grid.channels), np.float32)
    layer = np.stack(np.meshgrid([0], np.arange(by), np.arange(bx), indexing="ij"), axis=-1)
    for z in range(bz):
        constant = standing.constant(layer + np.array([z, 0, 0]))
        low[2 * z : 2 * z + 2] = np.repeat(np.repeat(constant, 2, 1), 2, 2)
    high = low.copy()
    for target, halves in zip((low, high), sparse_extrema(grid, standing, places), strict=True):
        _put_halves(target, places, halves)
    return low, high
