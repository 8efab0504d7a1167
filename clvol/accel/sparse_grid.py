"""Majorant grids over lattices that are mostly constant, for the device: cells found through a tree.

An entry of a node takes 4 bytes, a cell 4 more for its bound, and 4 for each channel of its controls.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.accel.cells import Cells
from clvol.volumes.tree import Tier, device_nodes

if TYPE_CHECKING:
    from clvol.accel.sparse_bounds import SparseBounds


class TreeGrid(NamedTuple):
    """links : int32 (m, 512), the tree (cl/geometry/lattice_tree.h), its values the rows of `cells`.

    levels : nodes on the way from its root to a cell.  cells : bounds of all cells, (n, channels).
    """

    links: np.ndarray
    levels: int
    cells: Cells


def tree_grid(bounds: SparseBounds) -> TreeGrid:
    """The cells of a lattice and the large constant ones above them, numbered."""
    leaves = [tier.leaf() for tier in bounds.tiers]
    first = np.cumsum([0, *(np.count_nonzero(leaf) for leaf in leaves)])

    def rows(number: int, tier: Tier) -> np.ndarray:
        leaf = leaves[number]
        found = np.zeros(leaf.shape, np.int64)
        found[leaf] = np.arange(first[number], first[number + 1])
        return found

    links = device_nodes([tier.tier for tier in bounds.tiers], rows)
    cells = Cells.joined(tier.cells.at(leaf) for tier, leaf in zip(bounds.tiers, leaves, strict=True))
    return TreeGrid(links, len(leaves), cells)
