"""Bounds of a field over a large lattice that is mostly constant: blocks of 8³ cells where it is not.

A block takes 4 KiB, or 6 with means; a leaf of a grid that stands alone in empty space makes two on the mean.
Above the blocks stands a tree (clvol.volumes.tree), whose entries are cells of 8, 64, ... times the edge:
what all walks through empty space and the costs of majorants go by.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.accel.bounds import Bounds, slackened
from clvol.accel.cells import Cells
from clvol.base.types import triple
from clvol.layout import BRICK_CELLS
from clvol.volumes.brick_samples import BOUND_CELLS
from clvol.volumes.transfer import made_of
from clvol.volumes.tree import (
    NODE_EDGE,
    Tier,
    build_tiers,
    entry_places,
    keys,
    levels_over,
    rows_of,
    unique_places,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from clvol.volumes.brick_tree import BrickTree
    from clvol.volumes.transfer import Transfer

_CHUNK = 1024
_CORNERS = np.array(list(np.ndindex(2, 2, 2)))


class BoundsTier(NamedTuple):
    """Nodes of one size, and the bounds of each of their entries, (n, 8, 8, 8, channels).

    sides : int64 (3, n, 8), finest cells of each entry along z, y, x, as far as they lie inside the lattice.
    edge : of an entry, in finest cells.
    """

    tier: Tier
    cells: Cells
    sides: np.ndarray
    edge: int

    def leaf(self, rows: slice = slice(None)) -> np.ndarray:
        """Entries of some nodes that lie inside the lattice and have no node below, bool (n, 8, 8, 8)."""
        valid = _product(self.sides[:, rows] > 0)
        return valid if self.edge == 1 else valid & (self.tier.below[rows] < 0)

    def summary(self) -> Cells:
        """Bounds of whole nodes, (n, channels)."""
        low, high, mean = self.cells
        low, high = low.min(axis=(1, 2, 3)), high.max(axis=(1, 2, 3))
        if mean is not None:
            weight = _product(self.sides.astype(np.float64))[..., None]
            mean = (mean * weight).sum(axis=(1, 2, 3)) / weight.sum(axis=(1, 2, 3))
            mean = np.clip(mean.astype(np.float32), low, high)
        return Cells(low, high, mean)


@dataclass(frozen=True, eq=False)
class SparseBounds:
    """Extrema, and perhaps means, of the cells of a lattice.

    blocks : int64 (n, 3), place z y x of each block of 8³ cells that is kept, in C order; 0, 0, 0 first.
    inside : bounds of their cells, (n, 8, 8, 8, channels).
    cells : cells per axis, x y z.  cell_size : a cell's edge in index units.
    constant : the field at places of bricks, int (..., 3), outside of all blocks: float32 (..., channels).
    transfer : what is made of its values, and bounded.
    """

    blocks: np.ndarray
    inside: Cells
    cells: tuple[int, int, int]
    cell_size: float
    constant: Callable[[np.ndarray], np.ndarray]
    transfer: Transfer | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells per axis, z y x."""
        return self.cells[::-1]

    def coarser(self) -> SparseBounds:
        """The same over cells of twice the edge; in a mean every cell that it merges counts the same."""
        blocks, _ = unique_places(self.blocks // 2)
        shape = triple(-(-n // 2) for n in self.shape)
        merged = _merged(self.inside, _sides(self.blocks, self.shape))
        row = rows_of(keys(self.blocks), keys(2 * blocks[:, None] + _CORNERS))
        parts = _like(self.inside, len(blocks))
        half = NODE_EDGE // 2
        for number, corner in enumerate(_CORNERS):
            at = (slice(None), *(slice(half * c, half * (c + 1)) for c in corner))
            found = row[:, number] >= 0
            first = (2 * blocks + corner) * NODE_EDGE * int(self.cell_size) // BRICK_CELLS
            fill = self._constants(first)
            for part, own, value in zip(parts.arrays(), merged.arrays(), fill.arrays(), strict=True):
                part[at] = value[:, None, None, None]
                part[at][found] = own[row[found, number]]
        inside = _masked(parts, _sides(blocks, shape))
        return SparseBounds(blocks, inside, shape[::-1], 2 * self.cell_size, self.constant, self.transfer)

    def whole(self) -> Bounds:
        """The same over a single cell that holds all."""
        cells = self.tiers[-1].summary().at(np.s_[:, None, None])
        return Bounds(cells.minimum, cells.maximum, max(self.cells) * self.cell_size, cells.mean)

    def groups(self) -> Iterator[tuple[Cells, list[np.ndarray]]]:
        """All cells that the lattice falls into, the large constant ones included, a bounded chunk at a time.

        Their bounds, (n, 8, 8, 8, channels), and along x, y, z their sides in cells of the lattice, as far as
        they lie inside it, (n, 8, 8, 8) by broadcasting; 0 for what a node stands below.
        """
        for tier in self.tiers:
            for first in range(0, len(tier.tier.nodes), _CHUNK):
                rows = slice(first, first + _CHUNK)
                z, y, x = _axes(tier.sides[:, rows])
                yield tier.cells.at(rows), [x * tier.leaf(rows), y, z]

    @cached_property
    def tiers(self) -> list[BoundsTier]:
        """The tree, lowest tier first: its nodes are the blocks; the last is the root alone."""
        below = np.full((len(self.blocks), *(NODE_EDGE,) * 3), -1, np.int32)
        sides = _sides(self.blocks, self.shape)
        tiers = [BoundsTier(Tier(self.blocks, below), self.inside, sides, 1)]
        levels = levels_over(self.shape) - 1
        for tier in build_tiers(self.blocks, levels) if levels else []:
            tiers.append(self._above(tiers[-1], tier))
        return tiers

    def _above(self, lower: BoundsTier, tier: Tier) -> BoundsTier:
        edge = lower.edge * NODE_EDGE
        sides = _sides(tier.nodes, self.shape, edge)
        cells = _like(self.inside, len(tier.nodes))
        for rows, places in entry_places(tier.nodes):
            fill = self._constants(places * edge * int(self.cell_size) // BRICK_CELLS)
            for part, value in zip(cells.arrays(), fill.arrays(), strict=True):
                part[rows] = value
        found = tier.below >= 0
        for part, own in zip(cells.arrays(), lower.summary().arrays(), strict=True):
            part[found] = own[tier.below[found]]
        return BoundsTier(tier, _masked(cells, sides), sides, edge)

    def _constants(self, bricks: np.ndarray) -> Cells:
        values = self.constant(bricks)
        low, high = slackened(values, values, values, values, 0.0, self.transfer)
        if self.inside.mean is None:
            return Cells(low, high, None)
        return Cells(low, high, made_of(values, self.transfer))


def sparse_bounds(bricks: BrickTree, means: bool, transfer: Transfer | None = None) -> SparseBounds:
    """Bounds with slack (clvol.accel.bounds) over the halves of a tree's bricks, with means if wanted.

    transfer : what is made of the interpolated values, and then bounded.
    """
    shape = triple(2 * n for n in bricks.shape)
    last = (np.array(shape) - 1) // NODE_EDGE
    reach = [np.clip((2 * bricks.places + offset) // NODE_EDGE, 0, last) for offset in 3 * _CORNERS - 1]
    blocks, _ = unique_places(np.concatenate([np.zeros((1, 3), np.int64), *reach]))
    halves = Cells(bricks.minimum, bricks.maximum, bricks.means(transfer) if means else None)
    inside = _like(halves, len(blocks))
    for first in range(0, len(blocks), _CHUNK):
        rows = slice(first, first + _CHUNK)
        own = _slack_inside(bricks, halves, blocks[rows], max(shape) * BOUND_CELLS, transfer)
        for part, values in zip(inside.arrays(), own.arrays(), strict=True):
            part[rows] = values

    def constant(places: np.ndarray) -> np.ndarray:
        return bricks.standing.constant(places)

    inside = _masked(inside, _sides(blocks, shape))
    return SparseBounds(blocks, inside, shape[::-1], BOUND_CELLS, constant, transfer)


def from_dense(bounds: Bounds) -> SparseBounds:
    """The same bounds as blocks, all of them kept."""
    shape = bounds.cells[::-1]
    count = tuple(-(-n // NODE_EDGE) for n in shape)
    blocks = np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1).reshape(-1, 3)
    pad = [(0, NODE_EDGE * c - n) for c, n in zip(count, shape, strict=True)] + [(0, 0)]

    def split(values: np.ndarray) -> np.ndarray:
        places = np.pad(values, pad).reshape(*(n for c in count for n in (c, NODE_EDGE)), values.shape[-1])
        return places.transpose(0, 2, 4, 1, 3, 5, 6).reshape(-1, *(NODE_EDGE,) * 3, values.shape[-1])

    channels = bounds.maximum.shape[-1]

    def constant(places: np.ndarray) -> np.ndarray:
        return np.zeros((*places.shape[:-1], channels), np.float32)

    inside = _masked(Cells(bounds.minimum, bounds.maximum, bounds.mean).each(split), _sides(blocks, shape))
    return SparseBounds(blocks, inside, bounds.cells, bounds.cell_size, constant)


def _slack_inside(
    bricks: BrickTree, halves: Cells, blocks: np.ndarray, size: int, transfer: Transfer | None
) -> Cells:
    """Bounds of the cells of blocks: 4³ bricks each, and the layer of cells around them."""
    per_block = NODE_EDGE // 2
    around = np.stack(np.meshgrid(*[np.arange(-1, per_block + 1)] * 3, indexing="ij"), axis=-1)
    places = np.clip(per_block * blocks[:, None, None, None] + around, 0, np.array(bricks.shape) - 1)
    row = bricks.find(places)
    constant = bricks.standing.constant(places)[..., None, None, None, :]

    def spread(values: np.ndarray, constant: np.ndarray = constant) -> np.ndarray:
        cells = np.broadcast_to(constant, (*row.shape, *values.shape[1:])).copy()
        cells[row >= 0] = values[row[row >= 0]]
        edge = 2 * row.shape[1]
        cells = cells.transpose(0, 1, 4, 2, 5, 3, 6, 7).reshape(len(blocks), edge, edge, edge, -1)
        return cells[:, 1:-1, 1:-1, 1:-1]

    wide = Cells(spread(halves.minimum), spread(halves.maximum), None)
    # at the lattice's border the clipped place repeats the border's own two cells: no other extremum
    least, most = _around(wide.minimum, np.minimum), _around(wide.maximum, np.maximum)
    inner = wide.at(np.s_[:, 1:-1, 1:-1, 1:-1])
    low, high = slackened(inner.minimum, inner.maximum, least, most, size, transfer)
    mean = None
    if halves.mean is not None:
        mean = spread(halves.mean, made_of(constant, transfer))[:, 1:-1, 1:-1, 1:-1]
    return Cells(low, high, mean)


def _around(values: np.ndarray, combine: np.ufunc) -> np.ndarray:
    """Extremum over each inner cell and its 26 neighbours: (n, 10, 10, 10, channels) to (n, 8, 8, 8, …)."""
    for axis in (1, 2, 3):
        n = values.shape[axis] - 2
        first, middle, last = (np.take(values, range(k, k + n), axis=axis) for k in range(3))
        values = combine(combine(first, middle), last)
    return values


def _like(cells: Cells, count: int) -> Cells:
    """Room for as many nodes."""
    shape = (count, *(NODE_EDGE,) * 3, cells.maximum.shape[-1])
    return cells.each(lambda _: np.empty(shape, np.float32))


def _sides(nodes: np.ndarray, shape: tuple[int, ...], edge: int = 1) -> np.ndarray:
    """Finest cells of the entries of nodes along each axis, as far as they lie in a lattice: (3, n, 8)."""
    first = edge * (NODE_EDGE * nodes.T[..., None] + np.arange(NODE_EDGE))
    return np.clip(np.array(shape)[:, None, None] - first, 0, edge)


def _axes(sides: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers along each axis, (3, n, 8), for broadcasting to (n, 8, 8, 8)."""
    z, y, x = sides
    return z[:, :, None, None], y[:, None, :, None], x[:, None, None, :]


def _product(sides: np.ndarray) -> np.ndarray:
    """Numbers along each axis, (3, n, 8), multiplied: (n, 8, 8, 8)."""
    z, y, x = _axes(sides)
    product: np.ndarray = z * y * x
    return product


def _masked(cells: Cells, sides: np.ndarray) -> Cells:
    """Cells that bound nothing beyond the lattice, in place."""
    if not (sides > 0).all():
        beyond = ~_product(sides > 0)
        for part, value in zip(cells, (np.inf, 0, 0), strict=True):
            if part is not None:
                part[beyond] = value
    return cells


def _merged(cells: Cells, sides: np.ndarray) -> Cells:
    """Blocks of 8³ cells to 4³ of twice the edge."""

    def eights(values: np.ndarray) -> np.ndarray:
        n, half = len(values), NODE_EDGE // 2
        return values.reshape(n, half, 2, half, 2, half, 2, -1)

    low = eights(cells.minimum).min(axis=(2, 4, 6))
    high = eights(cells.maximum).max(axis=(2, 4, 6))
    mean = None
    if cells.mean is not None:
        count = eights(_product(sides)).sum(axis=(2, 4, 6))
        mean = eights(cells.mean).sum(axis=(2, 4, 6), dtype=np.float64) / np.maximum(count, 1)
        mean = mean.astype(np.float32)
    return Cells(low, high, mean)
