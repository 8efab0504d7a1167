"""Adaptive kd-tree of majorants (after Yue et al. 2010): the cheapest one, built in vectorised NumPy.

Every box that halving the lattice can make is weighed, smallest first: as one leaf, or split along x, y
or z into the best trees of its halves, whichever costs a random ray least.  By integral geometry
(clvol.accel.costs) a leaf costs its volume × looseness in look-ups and a quarter of its surface in visits;
a visit starts at the root, so that each split adds a step to every visit below it.  The looseness is the
technique's (clvol.accel.controls): the majorant, less the control that decomposition subtracts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.accel.cells import Cells
from clvol.accel.controls import Control, scaled_majorant
from clvol.accel.kdtree_costs import DEEPER, LEAF, Costs, Key, Level, weigh
from clvol.base.types import triple

if TYPE_CHECKING:
    from clvol.accel.bounds import Bounds

MOST_CELLS = 64
"""Cells per axis of the finest lattice: all boxes of a 64³ lattice number 2 million."""
LEAF_BITS = np.uint32(3)
"""Low bits of a leaf's first word, which no inner node's has."""


@dataclass(frozen=True, eq=False)
class KdTree:
    """nodes : uint32 (n, 2), the layout of cl/majorant/kdtree.h, root first.

    minimum, maximum : float32 (leaves, channels), extrema of each leaf; its row's number is in its node.
    mean : float32 (leaves, channels), or None where the lattice had none.
    cost : expected cost of a random ray, in look-ups, times a quarter of the lattice's surface.
    leaves, depth : their number, and the longest way from the root.
    """

    nodes: np.ndarray
    minimum: np.ndarray
    maximum: np.ndarray
    mean: np.ndarray | None
    cost: float
    leaves: int
    depth: int


class Grown(NamedTuple):
    """Trees as nodes, uint32 (m, 2), the roots first, and the boxes of their leaves, in their order."""

    nodes: np.ndarray
    leaves: Cells
    depth: int


def tree_lattice(bounds: Bounds) -> Bounds:
    """The finest lattice a tree is built over: `bounds`, coarsened to MOST_CELLS per axis."""
    while max(bounds.cells) > MOST_CELLS:
        bounds = bounds.coarser()
    return bounds


def build_kdtree(
    bounds: Bounds,
    cell_extent: np.ndarray,
    rate: float,
    leaf_cost: float,
    step_cost: float,
    control: Control = "none",
    majorant_scale: float = 1.0,
) -> KdTree:
    """Build the cheapest tree over the cells of `bounds`, at most MOST_CELLS per axis.

    Parameters
    ----------
    cell_extent : float64 (3,), world lengths of a cell along x, y, z.
    rate : look-ups per world length and unit of the bound: the medium's largest scale.
    leaf_cost, step_cost : cost of a leaf's visit and of a step towards it from the root, in look-ups.
    control : what the technique subtracts; "fitted" needs `bounds.mean`.
    majorant_scale : multiplies the bounds, in the costs and in the nodes (extrema stay as they are).
    """
    costs = Costs(rate, leaf_cost, step_cost, control, majorant_scale)
    shape = bounds.maximum.shape[:3]
    depths = triple(int(n - 1).bit_length() for n in shape)
    edges = [
        (extent * np.minimum(np.arange((1 << depth) + 1), n))[None]
        for extent, n, depth in zip(cell_extent[::-1], shape, depths, strict=True)
    ]
    levels = weigh(_padded(bounds, depths), edges, depths, costs)
    grown = grow(levels, depths, majorant_scale)
    low, high, mean = grown.leaves
    cost = float(levels[0, 0, 0].cost[0, 0, 0, 0])
    return KdTree(grown.nodes, low, high, mean, cost, len(high), grown.depth)


def _padded(bounds: Bounds, depths: Key) -> Cells:
    """The lattice filled up to powers of two by cells that bound nothing; one of n."""
    pad = [(0, (1 << d) - n) for d, n in zip(depths, bounds.maximum.shape, strict=False)] + [(0, 0)]
    mean = None if bounds.mean is None else np.pad(bounds.mean, pad)[None]
    low, high = np.pad(bounds.minimum, pad, constant_values=np.inf), np.pad(bounds.maximum, pad)
    return Cells(low[None], high[None], mean)


def pack_maximum(high: np.ndarray) -> np.ndarray:
    """First word of a leaf: the maximum's bits with the two low ones set (rounds it up); 3 for an exact 0.

    Infinity would become a NaN and is refused; bounds of finite volumes never hold it.
    """
    high = np.asarray(high, np.float32)
    if not np.isfinite(high).all() or (high < 0).any():
        raise ValueError("majorants must be finite and not negative")
    bits = np.where(high > 0, high, np.float32(0)).view(np.uint32)
    return np.where(high > 0, np.maximum(bits, np.uint32(4)), bits) | LEAF_BITS


def unpack_maximum(words: np.ndarray) -> np.ndarray:
    """The float32 bound that the device reads from a leaf's first word."""
    words = np.ascontiguousarray(words, np.uint32)
    return np.where(words == 3, np.float32(0), words.view(np.float32))


def grow(
    levels: dict[Key, Level],
    depths: Key,
    majorant_scale: float,
    origins: np.ndarray | None = None,
    edge: int = 1,
    roots: np.ndarray | None = None,
    first: int = 0,
    first_leaf: int = 0,
) -> Grown:
    """Nodes of the n trees, breadth first, siblings side by side, and the leaves' boxes, in the same order.

    origins : int (n, 3), z y x of each lattice's first cell in finest cells; edge : of a cell, in those.
    roots : uint32 (n, 2^a, 2^b, 2^c, 2), the root of each cell's own tree, where there is one.
    first, first_leaf : numbers of the first node and leaf.
    """
    members = len(levels[0, 0, 0].cost)
    origins = np.zeros((members, 3), np.int64) if origins is None else origins
    keys, at = np.zeros((members, 3), np.int64), np.zeros((members, 3), np.int64)  # frontier: level, place
    member = np.arange(members)
    blocks, rows = [], []
    while len(at):
        split, boxes = _frontier(levels, keys, at, member)
        node = np.empty((len(at), 2), np.uint32)
        first += len(at)
        inner, leaf, deeper = (split >= 0) & (split < DEEPER), split == LEAF, split == DEEPER
        rows.append(boxes.at(leaf))
        node[leaf, 0] = pack_maximum(scaled_majorant(boxes.maximum[leaf], majorant_scale))
        node[leaf, 1] = first_leaf + np.arange(np.count_nonzero(leaf))
        if roots is not None:
            node[deeper] = roots[(member[deeper], *at[deeper].T)]
        first_leaf += int(np.count_nonzero(leaf))
        axis, owner = split[inner], member[inner]
        pair = np.arange(len(axis))
        keys, at = np.repeat(keys[inner], 2, axis=0), np.repeat(at[inner], 2, axis=0)
        member = np.repeat(owner, 2)
        for side in (0, 1):
            keys[2 * pair + side, axis] += 1
            at[2 * pair + side, axis] = 2 * at[2 * pair + side, axis] + side
        plane = at[1::2][pair, axis] << (np.array(depths)[axis] - keys[1::2][pair, axis])
        plane = origins[owner, axis] + edge * plane
        node[inner, 0] = (plane.astype(np.uint32) << 2) | (2 - axis).astype(np.uint32)
        node[inner, 1] = first + 2 * pair.astype(np.uint32)
        blocks.append(node)
    return Grown(np.concatenate(blocks), Cells.joined(rows), len(blocks))


def _frontier(
    levels: dict[Key, Level], keys: np.ndarray, at: np.ndarray, member: np.ndarray
) -> tuple[np.ndarray, Cells]:
    """Splits of the boxes `at` of the levels `keys` of lattices `member`, and those boxes, (n, channels)."""
    whole = levels[0, 0, 0].boxes
    split = np.empty(len(at), np.int64)
    boxes = whole.each(lambda values: np.empty((len(at), values.shape[-1]), np.float32))
    unique, group = np.unique(keys, axis=0, return_inverse=True)
    for number, key in enumerate(unique):
        of_key = group.reshape(-1) == number
        level, place = levels[triple(key)], (member[of_key], *at[of_key].T)
        split[of_key] = level.split[place]
        for values, known in zip(boxes.arrays(), level.boxes.arrays(), strict=True):
            values[of_key] = known[place]
    np.minimum(boxes.minimum, boxes.maximum, out=boxes.minimum)  # inf beyond the lattice
    return split, boxes
