"""Trees over lattices: nodes of 8³ entries, so that memory follows what differs from its surroundings.

An entry of a node stands for a cube of places: for a node below it, or for one value of all its places.
Where something stands at few places, a tree has at most one node of every size for each of them; a node
takes 2 KiB on the device (cl/geometry/lattice_tree.h).  Places are z, y, x throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

NODE_EDGE = 8
NODE_ENTRIES = NODE_EDGE**3
NODE_BYTES = 4 * NODE_ENTRIES
_BITS = 21
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Tier:
    """All nodes of one size.

    nodes : int64 (n, 3), the place of each node, in edges of a node.
    below : int32 (n, 8, 8, 8), the row of what stands at each entry in the tier below (for the lowest tier:
        among the places that the tree was built of), or -1 where nothing does.
    """

    nodes: np.ndarray
    below: np.ndarray


def keys(places: np.ndarray) -> np.ndarray:
    """One int64 for each place, int (..., 3) of 0 to 2²¹ - 1, in their C order."""
    z, y, x = np.moveaxis(places.astype(np.int64), -1, 0)
    key: np.ndarray = (z << 2 * _BITS) | (y << _BITS) | x
    return key


def unique_places(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different ones of (n, 3) places, int64 in C order, and the row of each place in them."""
    found, row = np.unique(keys(places), return_inverse=True)
    mask = (1 << _BITS) - 1
    return np.column_stack([found >> 2 * _BITS, found >> _BITS & mask, found & mask]), row.reshape(-1)


def unique_rows(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The different rows of (n, m), sorted, and the row of each in them.  As numpy.unique, but quick."""
    found, row = np.unique(values[:, 0], return_inverse=True)
    if values.shape[1] == 1:
        return found[:, None], row
    for column in values[:, 1:].T:
        own, inverse = np.unique(column, return_inverse=True)
        _, first, row = np.unique(row * len(own) + inverse, return_index=True, return_inverse=True)
    return values[first], row


def rows_of(sorted_keys: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Row of each wanted key among sorted ones, -1 where it is not there: intp of the shape of `wanted`."""
    if not len(sorted_keys):
        return np.full(wanted.shape, -1, np.intp)
    at = np.minimum(np.searchsorted(sorted_keys, wanted), len(sorted_keys) - 1)
    return np.where(sorted_keys[at] == wanted, at, -1)


def levels_over(shape: tuple[int, ...]) -> int:
    """Nodes on the way from the root of a tree to a place of a lattice of this shape; at least 1."""
    levels = 1
    while NODE_EDGE**levels < max(shape):
        levels += 1
    return levels


def build_tiers(places: np.ndarray, levels: int) -> list[Tier]:
    """The nodes over `places`, int (n, 3), all different, lowest tier first; the last is the root alone."""
    tiers = []
    for level in range(levels):
        nodes, owner = unique_places(places // NODE_EDGE)
        if level == levels - 1:  # also over no places at all
            nodes = np.zeros((1, 3), np.int64)
        below = np.full((len(nodes), *(NODE_EDGE,) * 3), -1, np.int32)
        z, y, x = (places - NODE_EDGE * nodes[owner]).T
        below[owner, z, y, x] = np.arange(len(places))
        tiers.append(Tier(nodes, below))
        places = nodes
    return tiers


def entry_places(nodes: np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """Places of all entries of nodes, a bounded chunk at a time: (rows, int64 (n, 8, 8, 8, 3))."""
    inner = np.stack(np.meshgrid(*[np.arange(NODE_EDGE)] * 3, indexing="ij"), axis=-1)
    for first in range(0, len(nodes), _CHUNK):
        rows = slice(first, min(first + _CHUNK, len(nodes)))
        yield rows, NODE_EDGE * nodes[rows, None, None, None] + inner


def device_nodes(tiers: list[Tier], values: Callable[[int, Tier], np.ndarray]) -> np.ndarray:
    """A tree as the device walks it, int32 (nodes, 512), root first; an entry of -n leads to node n.

    values : of a tier, by its number and itself, the value of each entry, int (n, 8, 8, 8), at least 0;
        it counts where no node is below.
    """
    counts = [len(tier.nodes) for tier in tiers]
    blocks = []
    for number in range(len(tiers) - 1, -1, -1):
        tier, entries = tiers[number], values(number, tiers[number])
        if number:  # nodes of the tier below come after this one
            entries = np.where(tier.below >= 0, -(sum(counts[number:]) + tier.below), entries)
        blocks.append(entries.reshape(-1, NODE_ENTRIES).astype(np.int32))
    return np.concatenate(blocks)
