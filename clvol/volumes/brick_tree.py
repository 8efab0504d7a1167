"""Brick maps of large grids that are mostly empty: the top grid is a tree, and only what differs is kept.

On the device a brick that varies takes 2,916 bytes, and a node of the tree 2,048; a leaf of a grid that
stands alone makes at most 8 such bricks (their far faces reach into it) and as many nodes of each size.
On the host a place that is kept takes 92 bytes, and as much again while it is found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import VolumeError
from clvol.layout import BRICK_CELLS, BRICK_EDGE
from clvol.volumes.brick_samples import (
    gather_sparse,
    half_means,
    sparse_extrema,
    sparse_lattice,
)
from clvol.volumes.files import place
from clvol.volumes.transfer import made_of
from clvol.volumes.tree import (
    NODE_ENTRIES,
    Tier,
    build_tiers,
    device_nodes,
    entry_places,
    keys,
    levels_over,
    rows_of,
    unique_rows,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.grid import SparseGrid
    from clvol.volumes.sparse_places import SparsePlaces
    from clvol.volumes.transfer import Transfer

COMPACT_BRICKS = 1 << 17
"""A box of no more brick places than this (a dense top grid of 512 KiB) has a dense top grid in any case."""
LEAST_SHARE = 1 / 16
"""Larger boxes have one where at least this share of the places holds something."""
MOST_EXTENT = 1 << 20
"""Samples per axis, at most: beyond, positions in float32 are coarser than 1/16 of a voxel."""
PRUNE = "the file is damaged, or has stray voxels far away: prune them"
_MOST_NODES = (1 << 31) // NODE_ENTRIES


@dataclass(frozen=True, eq=False)
class BrickTree:
    """A sparse grid ready for the device, its top grid a tree.

    places : int (n, 3), z y x of the bricks that are not what `standing.constant` says, in C order.
    numbers : int32 (n,), the number of the brick there.
    nodes : int32 (m, 512), the top grid (cl/geometry/lattice_tree.h).
    levels : nodes on the way from its root to a brick.
    minimum, maximum : float32 (n, 2, 2, 2, channels), extrema of the halves of those bricks.
    brick_count, constants, size, origin, channels : as in a BrickMap.
    """

    grid: SparseGrid
    standing: SparsePlaces
    places: np.ndarray
    numbers: np.ndarray
    nodes: np.ndarray
    levels: int
    brick_count: int
    constants: np.ndarray
    minimum: np.ndarray
    maximum: np.ndarray
    size: tuple[int, int, int]
    origin: tuple[int, int, int]
    channels: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Bricks per axis, z y x."""
        return self.standing.shape

    @property
    def top(self) -> np.ndarray:
        """Entries of the top grid as the device has them, int32 (m, 512): those below 0 lead to nodes."""
        return self.nodes

    @property
    def peak(self) -> np.ndarray:
        """The largest value of each channel, float32 (channels,)."""
        largest: np.ndarray = np.maximum(
            self.maximum.max(axis=(0, 1, 2, 3), initial=0), self.constants.max(axis=0, initial=0)
        )
        return largest

    def find(self, places: np.ndarray) -> np.ndarray:
        """Row of each place, int (...), among those that are kept, or -1."""
        return rows_of(keys(self.places), keys(places))

    def stored(self) -> Iterator[tuple[int, np.ndarray]]:
        """Every brick to store, a bounded chunk at a time: (first brick, float32 (n, 9, 9, 9, channels))."""
        yield from self._varying()
        for number, values in enumerate(self.constants, self.brick_count - len(self.constants)):
            yield (
                number,
                np.broadcast_to(values, (1, BRICK_EDGE, BRICK_EDGE, BRICK_EDGE, self.channels)).copy(),
            )

    def _varying(self) -> Iterator[tuple[int, np.ndarray]]:
        varies = self.numbers < self.brick_count - len(self.constants)
        first = 0
        for samples in gather_sparse(self.grid, self.standing, self.places[varies]):
            yield first, samples
            first += len(samples)

    def means(self, transfer: Transfer | None = None) -> np.ndarray:
        """Means of the interpolant over the halves of the kept bricks: float32 (n, 2, 2, 2, channels).

        transfer : of what it makes of the values, about: of the samples, interpolated.
        """
        means = made_of(self.minimum, transfer).copy()
        rows = np.flatnonzero(self.numbers < self.brick_count - len(self.constants))
        for first, samples in self._varying():
            means[rows[first : first + len(samples)]] = half_means(made_of(samples, transfer))
        return means.clip(self.minimum, self.maximum) if transfer is None else means


def is_scattered(shape: tuple[int, int, int], places: int) -> bool:
    """Whether a top grid is a tree: a large box, a small share of whose bricks holds something."""
    box = shape[0] * shape[1] * shape[2]
    return box > COMPACT_BRICKS and places < LEAST_SHARE * box


def build_tree(grid: SparseGrid, standing: SparsePlaces, places: np.ndarray) -> BrickTree:
    """Bound the bricks at `places` (`SparsePlaces.changing`), number them, and lay the tree over them.

    Raises VolumeError where the tree is too large for 32 bits.
    """
    size, origin = sparse_lattice(grid)
    low, high = sparse_extrema(grid, standing, places)
    lowest, highest = low.min(axis=(1, 2, 3)), high.max(axis=(1, 2, 3))
    varies = (lowest != highest).any(axis=1)
    kept = varies | (lowest != standing.constant(places)).any(axis=1)
    places, low, high, lowest, varies = (a[kept] for a in (places, low, high, lowest, varies))
    levels = levels_over(standing.shape)
    tiers = build_tiers(places, levels)
    if sum(len(tier.nodes) for tier in tiers) > _MOST_NODES:
        raise VolumeError(
            f"its bricks need more than {_MOST_NODES} nodes of a tree", place(grid.source, grid.name), PRUNE
        )
    values = [_constants(standing, tier, BRICK_CELLS**number) for number, tier in enumerate(tiers)]
    constants, (own, *rows) = _number_constants([lowest[~varies], *values])
    count = int(np.count_nonzero(varies))
    numbers = np.empty(len(places), np.int32)
    numbers[varies] = np.arange(count)
    numbers[~varies] = count + own

    def entries(number: int, tier: Tier) -> np.ndarray:
        found = count + rows[number]
        if number == 0 and len(numbers):
            found = np.where(tier.below >= 0, numbers[tier.below], found)
        return found

    nodes = device_nodes(tiers, entries)
    return BrickTree(
        grid,
        standing,
        places,
        numbers,
        nodes,
        levels,
        count + len(constants),
        constants,
        low,
        high,
        size,
        origin,
        grid.channels,
    )


def _number_constants(values: list[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """The different ones of values (..., channels), float32 (n, channels), and the row of each, int (...)."""
    channels = values[0].shape[-1]
    constants, row = unique_rows(np.concatenate([part.reshape(-1, channels) for part in values]))
    ends = np.cumsum([part.size // channels for part in values])
    parts = np.split(row, ends[:-1])
    return constants, [own.reshape(part.shape[:-1]) for own, part in zip(parts, values, strict=True)]


def check_extent(size: tuple[int, ...], where: str) -> None:
    """Refuse a box, in samples per axis, that floats cannot place."""
    if max(size) > MOST_EXTENT:
        raise VolumeError(
            f"its active samples span {max(size)} along an axis: more than the limit of {MOST_EXTENT}",
            where,
            PRUNE,
        )


def _constants(standing: SparsePlaces, tier: Tier, edge: int) -> np.ndarray:
    """What stands at each entry of a tier where nothing is kept, float32 (n, 8, 8, 8, channels).

    edge : of an entry, in bricks.
    """
    values = np.empty((*tier.below.shape, len(standing.background)), np.float32)
    for rows, at in entry_places(tier.nodes):
        values[rows] = standing.constant(at * edge)
    return values
