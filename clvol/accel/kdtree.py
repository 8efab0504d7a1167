"""Adaptive kd-tree of majorants (after Yue et al. 2010): the cheapest one, built in vectorised NumPy.

Every box that halving the lattice can make is weighed, smallest first: as one leaf, or split along x, y
or z into the best trees of its halves, whichever costs a random ray least.  By integral geometry
(clvol.accel.choice) a leaf costs its volume × bound in look-ups and a quarter of its surface in visits;
a visit starts at the root, so that each split adds a step to every visit below it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from clvol.accel.bounds import Bounds

MOST_CELLS = 64
"""Cells per axis of the finest lattice: all boxes of a 64³ lattice number 2 million."""
LEAF = -1

Key = tuple[int, int, int]
"""Halvings along z, y, x: level (a, b, c) has 2^a × 2^b × 2^c boxes."""


@dataclass(frozen=True, eq=False)
class KdTree:
    """nodes : uint32 (n, 2), the layout of cl/majorant/kdtree.h, root first.

    cost : expected cost of a random ray, in look-ups, times a quarter of the lattice's surface.
    leaves, depth : their number, and the longest way from the root.
    """

    nodes: np.ndarray
    cost: float
    leaves: int
    depth: int


@dataclass(frozen=True, eq=False)
class _Level:
    """All boxes of one size, arrays (2^a, 2^b, 2^c): extrema, cheapest cost, its leaf visits, its split."""

    minimum: np.ndarray
    maximum: np.ndarray
    cost: np.ndarray
    visits: np.ndarray
    split: np.ndarray  # axis 0 = z, 1 = y, 2 = x, or LEAF


def tree_lattice(bounds: Bounds) -> Bounds:
    """The finest lattice a tree is built over: `bounds`, coarsened to MOST_CELLS per axis."""
    while max(bounds.cells) > MOST_CELLS:
        bounds = bounds.coarser()
    return bounds


def build_kdtree(
    bounds: Bounds, cell_extent: np.ndarray, rate: float, leaf_cost: float, step_cost: float
) -> KdTree:
    """Build the cheapest tree over the cells of `bounds`, at most MOST_CELLS per axis.

    Parameters
    ----------
    cell_extent : float64 (3,), world lengths of a cell along x, y, z.
    rate : look-ups per world length and unit of the bound: the medium's scale.
    leaf_cost, step_cost : cost of a leaf's visit and of a step towards it from the root, in look-ups.
    """
    depths: Key = tuple(int(n - 1).bit_length() for n in bounds.maximum.shape)
    edges = [
        extent * np.arange(n + 1) for extent, n in zip(cell_extent[::-1], bounds.maximum.shape, strict=True)
    ]
    levels: dict[Key, _Level] = {}
    for key in sorted(product(*(range(d + 1) for d in depths)), key=sum, reverse=True):
        widths = [_widths(e, k, d) for e, k, d in zip(edges, key, depths, strict=True)]
        halves = {
            axis: levels[tuple(k + (a == axis) for a, k in enumerate(key))]
            for axis in range(3)
            if key[axis] < depths[axis]
        }
        extrema = _halved_extrema(halves) if halves else _padded(bounds, depths)
        levels[key] = _cheapest(*extrema, widths, halves, rate, leaf_cost, step_cost)
    root = levels[0, 0, 0]
    nodes, leaves, depth = _emit(levels, depths)
    return KdTree(nodes, float(root.cost[0, 0, 0]), leaves, depth)


def _widths(edges: np.ndarray, halvings: int, depth: int) -> np.ndarray:
    """World widths of the 2^halvings boxes along one axis; what reaches beyond the lattice counts as 0."""
    planes = np.arange((1 << halvings) + 1) << (depth - halvings)
    return np.diff(edges[np.minimum(planes, len(edges) - 1)])


def _padded(bounds: Bounds, depths: Key) -> tuple[np.ndarray, np.ndarray]:
    """Extrema over the lattice filled up to powers of two by cells that bound nothing."""
    pad = [(0, (1 << d) - n) for d, n in zip(depths, bounds.maximum.shape, strict=True)]
    return np.pad(bounds.minimum, pad, constant_values=np.inf), np.pad(bounds.maximum, pad)


def _pairs(values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """The first and the second of each two neighbours along an axis."""
    even, odd = [slice(None)] * 3, [slice(None)] * 3
    even[axis], odd[axis] = slice(0, None, 2), slice(1, None, 2)
    return values[tuple(even)], values[tuple(odd)]


def _halved_extrema(halves: dict[int, _Level]) -> tuple[np.ndarray, np.ndarray]:
    axis, level = next(iter(halves.items()))
    return np.minimum(*_pairs(level.minimum, axis)), np.maximum(*_pairs(level.maximum, axis))


def _cheapest(
    minimum: np.ndarray,
    maximum: np.ndarray,
    widths: list[np.ndarray],
    halves: dict[int, _Level],
    rate: float,
    leaf_cost: float,
    step_cost: float,
) -> _Level:
    """Weigh a leaf against a split along each axis that can still be halved."""
    w, h, d = widths[0][:, None, None], widths[1][None, :, None], widths[2][None, None, :]
    visits = np.where(w * h * d > 0, 0.5 * (w * h + h * d + d * w), 0.0)
    cost = w * h * d * rate * maximum + leaf_cost * visits
    split = np.full(cost.shape, LEAF, np.int8)
    for axis, level in halves.items():
        below = np.add(*_pairs(level.visits, axis))
        apart = np.add(*_pairs(level.cost, axis)) + step_cost * below
        cheaper = apart < cost
        cost, visits = np.where(cheaper, apart, cost), np.where(cheaper, below, visits)
        split[cheaper] = axis
    return _Level(minimum, maximum, cost, visits, split)


def pack_maximum(high: np.ndarray) -> np.ndarray:
    """First word of a leaf: the maximum's bits with the two low ones set (rounds it up); 3 for an exact 0.

    Infinity would become a NaN and is refused; bounds of finite volumes never hold it.
    """
    high = np.asarray(high, np.float32)
    if not np.isfinite(high).all() or (high < 0).any():
        raise ValueError("majorants must be finite and not negative")
    bits = np.where(high > 0, high, np.float32(0)).view(np.uint32)
    return np.where(high > 0, np.maximum(bits, np.uint32(4)), bits) | np.uint32(3)


def _emit(levels: dict[Key, _Level], depths: Key) -> tuple[np.ndarray, int, int]:
    """Nodes in breadth-first order, siblings side by side; the number of leaves, and the depth."""
    keys, at = np.zeros((1, 3), np.int64), np.zeros((1, 3), np.int64)  # frontier: level and place, z y x
    first, blocks, leaves = 0, [], 0
    while len(at):
        node, split = _frontier(levels, keys, at)
        first += len(at)
        inner = split != LEAF
        leaves += int(np.count_nonzero(~inner))
        axis = split[inner]
        rows = np.arange(len(axis))
        keys, at = np.repeat(keys[inner], 2, axis=0), np.repeat(at[inner], 2, axis=0)
        for side in (0, 1):
            keys[2 * rows + side, axis] += 1
            at[2 * rows + side, axis] = 2 * at[2 * rows + side, axis] + side
        plane = at[1::2][rows, axis] << (np.array(depths)[axis] - keys[1::2][rows, axis])
        node[inner, 0] = (plane.astype(np.uint32) << 2) | (2 - axis).astype(np.uint32)
        node[inner, 1] = first + 2 * rows.astype(np.uint32)
        blocks.append(node)
    return np.concatenate(blocks), leaves, len(blocks)


def _frontier(levels: dict[Key, _Level], keys: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leaf records and splits of the boxes `at` of the levels `keys`."""
    node = np.empty((len(at), 2), np.uint32)
    split = np.empty(len(at), np.int64)
    unique, group = np.unique(keys, axis=0, return_inverse=True)
    for number, key in enumerate(unique):
        members = group.reshape(-1) == number
        level, place = levels[tuple(int(k) for k in key)], tuple(at[members].T)
        node[members, 0] = pack_maximum(level.maximum[place])
        node[members, 1] = np.minimum(level.minimum[place], level.maximum[place]).view(np.uint32)
        split[members] = level.split[place]
    return node, split
