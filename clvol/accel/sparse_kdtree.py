"""Kd-trees of majorants over lattices that are mostly constant, along the nodes of their tree of blocks.

The trees within all nodes of a tier are weighed together (clvol.accel.kdtree), the lowest first; in the tier
above, a node that stands below a cell is one more thing that the cell may be: a leaf, or its own tree.  So
time and memory go with the blocks, not with the box.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.accel.bounds import Bounds
from clvol.accel.cells import Cells
from clvol.accel.kdtree import LEAF_BITS, KdTree, build_kdtree, grow, tree_lattice
from clvol.accel.kdtree_costs import Costs, Key, Within, weigh
from clvol.volumes.tree import NODE_EDGE

if TYPE_CHECKING:
    from clvol.accel.controls import Control
    from clvol.accel.sparse_bounds import BoundsTier, SparseBounds

MOST_BLOCKS = 8192
"""Blocks of the finest lattice a tree is built over: 4 million cells."""
_CHUNK = 256
_DEPTHS: Key = (3, 3, 3)


def finest_lattice(bounds: Bounds | SparseBounds) -> Bounds | SparseBounds:
    """The finest lattice a tree is built over: `bounds`, coarsened to what the builder can weigh."""
    if isinstance(bounds, Bounds):
        return tree_lattice(bounds)
    while len(bounds.blocks) > MOST_BLOCKS:
        bounds = bounds.coarser()
    return bounds


def build_tree(
    bounds: Bounds | SparseBounds,
    cell_extent: np.ndarray,
    rate: float,
    leaf_cost: float,
    step_cost: float,
    control: Control = "none",
    majorant_scale: float = 1.0,
) -> KdTree:
    """The cheapest tree over a lattice, as `build_kdtree` takes it or sparse."""
    if isinstance(bounds, Bounds):
        return build_kdtree(bounds, cell_extent, rate, leaf_cost, step_cost, control, majorant_scale)
    costs = Costs(rate, leaf_cost, step_cost, control, majorant_scale)
    builder = _Builder(bounds, cell_extent[::-1], costs)
    for tier in bounds.tiers:
        builder.add(tier)
    return builder.result()


class _Builder:
    """Grows the trees of all tiers, lowest first; keeps the roots, costs and visits of the tier before."""

    def __init__(self, bounds: SparseBounds, extent: np.ndarray, costs: Costs) -> None:
        self.shape, self.extent, self.costs = bounds.shape, extent, costs
        self.nodes: list[np.ndarray] = []
        self.leaves: list[Cells] = []
        self.node_count = self.leaf_count = 0
        self.roots, self.cost, self.visits = np.empty((0, 2), np.uint32), np.empty(0), np.empty(0)

    def add(self, tier: BoundsTier) -> None:
        """The trees within all nodes of a tier."""
        parts = [self._chunk(tier, slice(k, k + _CHUNK)) for k in range(0, len(tier.tier.nodes), _CHUNK)]
        self.roots, self.cost, self.visits = (np.concatenate(part) for part in zip(*parts, strict=True))

    def _chunk(self, tier: BoundsTier, rows: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        nodes, below = tier.tier.nodes[rows], tier.tier.below[rows]
        origins = NODE_EDGE * tier.edge * nodes
        planes = tier.edge * np.arange(NODE_EDGE + 1)
        edges = [
            extent * np.minimum(origins[:, axis, None] + planes, self.shape[axis])
            for axis, extent in enumerate(self.extent)
        ]
        within = roots = None
        if tier.edge > 1:
            within = Within(np.append(self.cost, np.inf)[below], np.append(self.visits, 0.0)[below])
            roots = np.append(self.roots, np.zeros((1, 2), np.uint32), axis=0)[below]
        levels = weigh(tier.cells.at(rows), edges, _DEPTHS, self.costs, within)
        scale = self.costs.majorant_scale
        grown = grow(levels, _DEPTHS, scale, origins, tier.edge, roots, self.node_count, self.leaf_count)
        self.nodes.append(grown.nodes)
        self.leaves.append(grown.leaves)
        self.node_count += len(grown.nodes)
        self.leaf_count += len(grown.leaves.maximum)
        best = levels[0, 0, 0]
        return grown.nodes[: len(nodes)], best.cost[:, 0, 0, 0], best.visits[:, 0, 0, 0]

    def result(self) -> KdTree:
        """The root's tree, breadth first, without what no longer hangs on it."""
        nodes = np.concatenate([*self.nodes, self.roots])
        order, frontier, depth = [], np.array([len(nodes) - 1]), 0
        while len(frontier):
            order.append(frontier)
            children = nodes[frontier[~_is_leaf(nodes[frontier])], 1].astype(np.int64)
            frontier = np.column_stack([children, children + 1]).reshape(-1)
            depth += 1
        found = nodes[np.concatenate(order)]
        leaf = _is_leaf(found)
        row = found[leaf, 1].astype(np.int64)
        found[leaf, 1] = np.arange(len(row))
        found[~leaf, 1] = 1 + 2 * np.arange(np.count_nonzero(~leaf))  # breadth first, the root is number 0
        low, high, mean = Cells.joined(self.leaves).at(row)
        return KdTree(found, low, high, mean, float(self.cost[0]), len(row), depth)


def _is_leaf(nodes: np.ndarray) -> np.ndarray:
    leaf: np.ndarray = (nodes[:, 0] & LEAF_BITS) == LEAF_BITS
    return leaf
