"""Brick maps: any grid as 8³-cell bricks of 9³ samples under a top grid, built in bounded memory.

A brick holds the samples of its cells and of their far faces, so that a trilinear look-up never
leaves it, and its extrema bound every interpolated value of the brick (METHODS §5, halo included).
Bricks that are constant are stored once per value.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from clvol.volumes.grid import DenseGrid, Grid, SparseGrid

BRICK_CELLS = 8
BRICK_EDGE = BRICK_CELLS + 1
BRICK_SAMPLES = BRICK_EDGE**3
BOUND_CELLS = 4
"""Edge, in grid cells, of the finest extrema that are kept: half a brick."""
_CHUNK_BRICKS = 4096


@dataclass(frozen=True, eq=False)
class BrickMap:
    """A grid ready for the device.

    top : int32 (bz, by, bx), number of the brick at each place.
    brick_count : bricks to store; constants : float32 (n, channels), values of the last n of them.
    minimum, maximum : float32 (2bz, 2by, 2bx), extrema over each cube of 4³ cells and all channels, of
        any trilinear, nearest or ½-voxel jittered value in it.
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

    def stored(self) -> Iterator[tuple[int, np.ndarray]]:
        """Every brick to store, a bounded chunk at a time: (first brick, float32 (n, 9, 9, 9, channels))."""
        varying = self.brick_count - len(self.constants)
        for places, samples in _iterate(self.grid):
            numbers = self.top[tuple(places.T)]
            stored = numbers < varying
            if stored.any():
                first = int(numbers[stored].min())  # numbered in the order of iteration: consecutive
                yield first, np.ascontiguousarray(samples[stored])
        for number, values in enumerate(self.constants, varying):
            yield (
                number,
                np.broadcast_to(values, (1, BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, self.channels)).copy(),
            )


def build_bricks(grid: Grid) -> BrickMap:
    """Find which bricks of `grid` vary, number them, and bound them.  Reads the grid once."""
    size, origin, places_per_axis = _lattice(grid)
    bx, by, bz = places_per_axis
    channels = grid.values.shape[3] if isinstance(grid, DenseGrid) else 1
    fill = np.float32(grid.background if isinstance(grid, SparseGrid) else 0)
    top = np.full((bz, by, bx), -1, np.int32)
    constant = np.full((bz, by, bx, channels), fill, np.float32)
    if isinstance(grid, SparseGrid):
        constant[..., 0] = _Leaves(grid).value[:-1, :-1, :-1]
    half = np.repeat(np.repeat(np.repeat(constant, 2, 0), 2, 1), 2, 2)
    minimum, maximum = half.min(axis=3), half.max(axis=3)
    del half
    count = 0
    for places, samples in _iterate(grid):
        low, high = samples.min(axis=(1, 2, 3)), samples.max(axis=(1, 2, 3))
        varies = (low != high).any(axis=1)
        numbers = np.full(len(places), -1, np.int32)
        numbers[varies] = count + np.arange(np.count_nonzero(varies))
        count += int(np.count_nonzero(varies))
        z, y, x = places.T
        top[z, y, x] = numbers
        constant[z, y, x] = low
        _bound_halves(samples, places, minimum, maximum)
    unique, inverse = np.unique(constant[top < 0], axis=0, return_inverse=True)
    top[top < 0] = count + inverse.reshape(-1)
    return BrickMap(grid, top, count + len(unique), unique, minimum, maximum, size, origin, channels)


def _bound_halves(samples: np.ndarray, places: np.ndarray, minimum: np.ndarray, maximum: np.ndarray) -> None:
    """Extrema of the eight 4³-cell cubes of each brick, written at their places in the fine lattice."""
    z, y, x = 2 * places.T
    low, high = samples.min(axis=4), samples.max(axis=4)
    parts = (slice(0, 5), slice(4, 9))
    for dz in (0, 1):
        for dy in (0, 1):
            for dx in (0, 1):
                cut = (slice(None), parts[dz], parts[dy], parts[dx])
                minimum[z + dz, y + dy, x + dx] = low[cut].min(axis=(1, 2, 3))
                maximum[z + dz, y + dy, x + dx] = high[cut].max(axis=(1, 2, 3))


def _lattice(grid: Grid) -> tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]:
    """Samples per axis, index of the first sample, and bricks per axis, each as x, y, z."""
    if isinstance(grid, DenseGrid):
        size = tuple(max(n, 2) for n in grid.values.shape[2::-1])
        origin = (0, 0, 0)
    else:  # active box plus one voxel all round, its start moved down to a leaf's
        lower = (grid.active_box[0] - 1) // BRICK_CELLS * BRICK_CELLS
        size = tuple(int(n) for n in grid.active_box[1] + 2 - lower)
        origin = tuple(int(n) for n in lower)
    bricks = tuple(-(-(n - 1) // BRICK_CELLS) for n in size)
    return size, origin, bricks


def _iterate(grid: Grid) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Chunks of bricks that may vary: places int (n, 3) as z, y, x, and samples (n, 9, 9, 9, channels)."""
    return _iterate_dense(grid) if isinstance(grid, DenseGrid) else _iterate_sparse(grid)


def _iterate_dense(grid: DenseGrid) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    _, _, (bx, by, bz) = _lattice(grid)
    nz, ny, nx, channels = grid.values.shape
    ys = np.minimum(np.arange(by * BRICK_CELLS + 1), ny - 1)
    xs = np.minimum(np.arange(bx * BRICK_CELLS + 1), nx - 1)
    y, x = (a.reshape(-1) for a in np.meshgrid(np.arange(by), np.arange(bx), indexing="ij"))
    for z in range(bz):
        zs = np.minimum(np.arange(z * BRICK_CELLS, z * BRICK_CELLS + BRICK_EDGE), nz - 1)
        slab = np.ascontiguousarray(grid.values[zs[0] : zs[-1] + 1])
        slab = slab[np.ix_(zs - zs[0], ys, xs)]
        windows = np.lib.stride_tricks.sliding_window_view(slab, (BRICK_EDGE, BRICK_EDGE), axis=(1, 2))
        windows = windows[:, ::BRICK_CELLS, ::BRICK_CELLS]  # (9, by, bx, channels, 9, 9)
        samples = windows.transpose(1, 2, 0, 4, 5, 3).reshape(
            by * bx, BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, channels
        )
        yield np.stack([np.full_like(y, z), y, x], axis=1), samples


class _Leaves:
    """Which leaf, or which constant value, stands at each brick place (one more place per axis)."""

    def __init__(self, grid: SparseGrid) -> None:
        _, origin, (bx, by, bz) = _lattice(grid)
        self.leaf = np.full((bz + 1, by + 1, bx + 1), -1, np.int32)
        self.value = np.full((bz + 1, by + 1, bx + 1), grid.background, np.float32)
        limit = np.array([bx + 1, by + 1, bz + 1])
        for start, edge, value in zip(grid.tile_origins, grid.tile_sizes, grid.tile_values, strict=True):
            a = np.clip((start - origin) // BRICK_CELLS, 0, limit)
            b = np.clip((start + edge - origin) // BRICK_CELLS, 0, limit)
            self.value[a[2] : b[2], a[1] : b[1], a[0] : b[0]] = value
        at = (grid.leaf_origins - np.array(origin, np.int32)) // BRICK_CELLS
        inside = ((at >= 0) & (at < limit)).all(axis=1)
        x, y, z = at[inside].T
        self.leaf[z, y, x] = np.nonzero(inside)[0]


def _iterate_sparse(grid: SparseGrid) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    leaves = _Leaves(grid)
    bz, by, bx = (n - 1 for n in leaves.leaf.shape)
    corners = [(dz, dy, dx) for dz in (0, 1) for dy in (0, 1) for dx in (0, 1)]
    shifted = [(slice(dz, dz + bz), slice(dy, dy + by), slice(dx, dx + bx)) for dz, dy, dx in corners]
    varies = np.zeros((bz, by, bx), bool)
    for cut in shifted:
        varies |= (leaves.leaf[cut] >= 0) | (leaves.value[cut] != leaves.value[:-1, :-1, :-1])
    places = np.argwhere(varies)
    for first in range(0, len(places), _CHUNK_BRICKS):
        chunk = places[first : first + _CHUNK_BRICKS]
        samples = np.empty((len(chunk), BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, 1), np.float32)
        for corner in corners:
            source = tuple(slice(0, 1) if d else slice(0, 8) for d in corner)
            target = tuple(slice(8, 9) if d else slice(0, 8) for d in corner)
            z, y, x = (chunk + np.array(corner)).T
            leaf = leaves.leaf[z, y, x]
            block = np.empty((len(chunk), *(s.stop for s in source)), np.float32)
            block[:] = leaves.value[z, y, x][:, None, None, None]
            filled = leaf >= 0
            block[filled] = grid.leaf_values[leaf[filled]][(slice(None), *source)]
            samples[(slice(None), *target, 0)] = block
        yield chunk, samples
