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
        gather = _gather_dense if isinstance(self.grid, DenseGrid) else _gather_sparse
        first = 0
        for samples in gather(self.grid, self.top < self.brick_count - len(self.constants)):
            yield first, samples
            first += len(samples)

    def means(self) -> np.ndarray:
        """Mean of the trilinear interpolant over each cube of 4³ cells: float32 (2bz, 2by, 2bx, channels).

        Exact, by the trapezoid rule along each axis.  Reads the grid once more, in bounded memory.
        """
        varying = self.brick_count - len(self.constants)
        varies = self.top < varying
        values = np.empty((*self.top.shape, self.channels), np.float32)
        values[~varies] = self.constants[self.top[~varies] - varying]
        means = np.repeat(np.repeat(np.repeat(values, 2, 0), 2, 1), 2, 2)
        places = np.argwhere(varies)
        for first, samples in self._varying():
            _put_halves(means, places[first : first + len(samples)], _half_means(samples))
        return np.clip(means, self.minimum, self.maximum)


def build_bricks(grid: Grid) -> BrickMap:
    """Find which bricks of `grid` vary, number them, and bound them.  Reads the grid once."""
    size, origin, _ = _lattice(grid)
    low, high = _extrema_dense(grid) if isinstance(grid, DenseGrid) else _extrema_sparse(grid)
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


def _half_extrema(samples: np.ndarray, axis: int, combine: np.ufunc) -> np.ndarray:
    """Extrema over stretches of BOUND_CELLS cells, both end samples included, along one axis."""
    count = (samples.shape[axis] - 1) // BOUND_CELLS
    shape = samples.shape
    inner = [slice(None)] * samples.ndim
    inner[axis] = slice(0, count * BOUND_CELLS)
    blocks = samples[tuple(inner)].reshape(*shape[:axis], count, BOUND_CELLS, *shape[axis + 1 :])
    ends = [slice(None)] * samples.ndim
    ends[axis] = slice(BOUND_CELLS, None, BOUND_CELLS)
    return combine(combine.reduce(blocks, axis=axis + 1), samples[tuple(ends)])


def _half_means(samples: np.ndarray) -> np.ndarray:
    """Means over the half bricks of bricks: (n, 9, 9, 9, channels) to float64 (n, 2, 2, 2, channels)."""
    trapezoid = np.zeros((2, BRICK_EDGE))
    for half, first in enumerate((0, BOUND_CELLS)):
        trapezoid[half, first : first + BOUND_CELLS + 1] = 1 / BOUND_CELLS
        trapezoid[half, [first, first + BOUND_CELLS]] /= 2
    weights = np.einsum("az,by,cx->zyxabc", trapezoid, trapezoid, trapezoid).reshape(BRICK_SAMPLES, 8)
    count, channels = len(samples), samples.shape[-1]
    by_channel = np.moveaxis(samples, -1, 1).reshape(count * channels, BRICK_SAMPLES)
    means = by_channel.astype(np.float64) @ weights
    return np.moveaxis(means.reshape(count, channels, 2, 2, 2), 1, -1)


def _put_halves(target: np.ndarray, places: np.ndarray, halves: np.ndarray) -> None:
    """Write values of half bricks, (n, 2, 2, 2, channels), where the bricks at `places` have theirs.

    places : int (n, 3), z y x.
    """
    z, y, x = 2 * places.T
    for dz, dy, dx in np.ndindex(2, 2, 2):
        target[z + dz, y + dy, x + dx] = halves[:, dz, dy, dx]


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


def _slabs(grid: DenseGrid) -> Iterator[np.ndarray]:
    """The samples of each layer of bricks, float32 (9, 8by + 1, 8bx + 1, channels), borders repeated."""
    _, _, (bx, by, bz) = _lattice(grid)
    nz, ny, nx, _ = grid.values.shape
    ys = np.minimum(np.arange(by * BRICK_CELLS + 1), ny - 1)
    xs = np.minimum(np.arange(bx * BRICK_CELLS + 1), nx - 1)
    for z in range(0, bz * BRICK_CELLS, BRICK_CELLS):
        zs = np.minimum(np.arange(z, z + BRICK_EDGE), nz - 1)
        yield grid.values[zs[0] : zs[-1] + 1][np.ix_(zs - zs[0], ys, xs)]


def _extrema_dense(grid: DenseGrid) -> tuple[np.ndarray, np.ndarray]:
    """Extrema of every half brick: two arrays (2bz, 2by, 2bx, channels)."""
    lows, highs = [], []
    for slab in _slabs(grid):
        low = high = slab
        for axis in range(3):
            low, high = _half_extrema(low, axis, np.minimum), _half_extrema(high, axis, np.maximum)
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


def _extrema_sparse(grid: SparseGrid) -> tuple[np.ndarray, np.ndarray]:
    """Extrema of every half brick: two arrays (2bz, 2by, 2bx, 1)."""
    leaves = _Leaves(grid)
    bz, by, bx = (n - 1 for n in leaves.leaf.shape)
    constant = leaves.value[:-1, :-1, :-1, None]
    low = np.repeat(np.repeat(np.repeat(constant, 2, 0), 2, 1), 2, 2)
    high = low.copy()
    varies = np.zeros((bz, by, bx), bool)
    for dz, dy, dx in np.ndindex(2, 2, 2):
        cut = (slice(dz, dz + bz), slice(dy, dy + by), slice(dx, dx + bx))
        varies |= (leaves.leaf[cut] >= 0) | (leaves.value[cut] != constant[..., 0])
    places = np.argwhere(varies)
    for first, samples in zip(
        range(0, len(places), _CHUNK_BRICKS), _gather_sparse(grid, varies), strict=True
    ):
        for combine, target in ((np.minimum, low), (np.maximum, high)):
            halves = samples
            for axis in (1, 2, 3):
                halves = _half_extrema(halves, axis, combine)
            _put_halves(target, places[first : first + _CHUNK_BRICKS], halves)
    return low, high


def _gather_sparse(grid: SparseGrid, wanted: np.ndarray) -> Iterator[np.ndarray]:
    """Samples of the wanted bricks, a chunk at a time: (n, 9, 9, 9, 1), far faces from the neighbours."""
    leaves = _Leaves(grid)
    places = np.argwhere(wanted)
    for first in range(0, len(places), _CHUNK_BRICKS):
        chunk = places[first : first + _CHUNK_BRICKS]
        samples = np.empty((len(chunk), BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, 1), np.float32)
        for corner in np.ndindex(2, 2, 2):
            source = tuple(slice(0, 1) if d else slice(0, 8) for d in corner)
            target = tuple(slice(8, 9) if d else slice(0, 8) for d in corner)
            z, y, x = (chunk + np.array(corner)).T
            leaf = leaves.leaf[z, y, x]
            block = np.empty((len(chunk), *(s.stop for s in source)), np.float32)
            block[:] = leaves.value[z, y, x][:, None, None, None]
            filled = leaf >= 0
            block[filled] = grid.leaf_values[leaf[filled]][(slice(None), *source)]
            samples[(slice(None), *target, 0)] = block
        yield samples
