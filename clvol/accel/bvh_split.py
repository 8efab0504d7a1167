"""Binary trees over boxes by binned surface-area heuristic (Wald 2007), all nodes of a level at once.

A leaf is one packet of at most BVH_PACKET primitives, which the device tests together, so that what a node
costs is its number of packets.  Boxes are kept as six rows (lower x, y, z, -upper x, y, z): every reduction
is a minimum.  A level's nodes are worked on in chunks, to bound the temporaries.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.layout import BVH_MOST_DEPTH, BVH_PACKET

_BINS = 16
_CHUNK = 1 << 18


@dataclass(frozen=True, eq=False)
class BinaryTree:
    """A binary tree of boxes over primitives.

    box : float32 (6, nodes), rows lower x, y, z, -upper x, y, z; root first.
    left : int32 (nodes,), the first of two neighbouring children; -1 in a leaf.
    first, count : int32 (nodes,), a leaf's primitives order[first : first + count].
    order : int32 (primitives,).
    """

    box: np.ndarray
    left: np.ndarray
    first: np.ndarray
    count: np.ndarray
    order: np.ndarray


@dataclass
class _Level:
    """Nodes that are still to be split: node i owns columns start[i] to start[i + 1] of `order` and `box`."""

    order: np.ndarray
    box: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    """Of each node; with `plane`, the last bin of the left half.  -1: halve by number."""
    plane: np.ndarray
    low: np.ndarray
    """Smallest doubled centroid along x, y, z: float32 (3, nodes)."""
    scale: np.ndarray
    """Bins per doubled length: float32 (3, nodes)."""


def split_boxes(box: np.ndarray) -> BinaryTree:
    """The tree over the columns of `box`: float32 (6, primitives), at least one, which it may overwrite."""
    size = box.shape[1]
    nodes = [np.min(box, axis=1, keepdims=True)]
    left, first, count = [], [], []
    order, start = np.arange(size, dtype=np.int32), np.array([0, size])
    leaves, leaf_total, known, depth = [], 0, 1, 0
    while len(start) > 1:
        counts = np.diff(start)
        inner = counts > BVH_PACKET
        children = np.full(len(counts), -1, np.int32)
        children[inner] = known + 2 * np.arange(np.count_nonzero(inner))
        known += 2 * int(np.count_nonzero(inner))
        places = np.zeros(len(counts), np.int32)
        places[~inner] = leaf_total + np.cumsum(counts[~inner]) - counts[~inner]
        left.append(children)
        first.append(places)
        count.append(np.where(inner, 0, counts).astype(np.int32))
        if not inner.all():
            active = np.repeat(inner, counts)
            leaves.append(order[~active])
            leaf_total += len(leaves[-1])
            order, box = order[active], box[:, active]
            start = np.concatenate(([0], np.cumsum(counts[inner])))
        level = _choose_splits(order, box, start, depth)
        order, box, start, child_boxes = _divide(level)
        nodes.append(child_boxes)
        depth += 1
    parts = (np.concatenate(part, dtype=np.int32) for part in (left, first, count, leaves))
    return BinaryTree(np.concatenate(nodes, axis=1), *parts)


def half_area(box: np.ndarray) -> np.ndarray:
    """Half the surface of boxes (6, ...); 0 for empty ones."""
    x, y, z = (-(box[a] + box[a + 3]) for a in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(x >= 0, x * y + y * z + z * x, np.float32(0))


def _chunks(start: np.ndarray) -> list[tuple[int, int]]:
    """Ranges of nodes of about _CHUNK primitives; a larger node is alone."""
    ranges, first, nodes = [], 0, len(start) - 1
    while first < nodes:
        last = int(np.searchsorted(start, start[first] + _CHUNK, side="right")) - 1
        last = min(max(last, first + 1), nodes)
        ranges.append((first, last))
        first = last
    return ranges


def _choose_splits(order: np.ndarray, box: np.ndarray, start: np.ndarray, depth: int) -> _Level:
    """The cheapest plane of every node."""
    nodes = len(start) - 1
    level = _Level(
        order,
        box,
        start,
        np.full(nodes, -1, np.int8),
        np.zeros(nodes, np.int8),
        *np.empty((2, 3, nodes), np.float32),
    )
    for first, last in _chunks(start):
        _choose_in_chunk(level, first, last)
    packets = np.diff(start) / BVH_PACKET
    level.axis[depth + np.ceil(np.log2(packets)) >= BVH_MOST_DEPTH] = -1
    return level


def _choose_in_chunk(level: _Level, first: int, last: int) -> None:
    """Weigh the planes between bins of nodes first to last along each axis: areas times packets."""
    here = slice(level.start[first], level.start[last])
    starts = level.start[first:last] - level.start[first]
    counts = np.diff(level.start[first : last + 1])
    node = np.repeat(np.arange(last - first, dtype=np.int32), counts)
    best = np.full(last - first, np.inf, np.float32)
    bins = _BINS if (last - first) * 64 < here.stop - here.start else _BINS // 2
    for axis in range(3):
        centroid = level.box[axis, here] - level.box[axis + 3, here]
        low = np.minimum.reduceat(centroid, starts)
        extent = np.maximum.reduceat(centroid, starts) - low
        usable = (extent > 0) & np.isfinite(extent)
        scale = np.divide(np.float32(bins), extent, out=np.zeros_like(extent), where=usable)
        scale[~np.isfinite(scale)] = 0
        level.low[axis, first:last], level.scale[axis, first:last] = low, scale
        key = _bin_of(centroid, low[node], scale[node], bins) + node * bins
        cost = _plane_costs(level.box[:, here], key, last - first, bins)
        plane = np.argmin(cost, axis=1)
        cost = np.take_along_axis(cost, plane[:, None], axis=1)[:, 0]
        cheaper = cost < best
        best[cheaper] = cost[cheaper]
        level.axis[first:last][cheaper], level.plane[first:last][cheaper] = axis, plane[cheaper]


def _bin_of(centroid: np.ndarray, low: np.ndarray, scale: np.ndarray, bins: int) -> np.ndarray:
    """Bin of each doubled centroid, int32."""
    number: np.ndarray = np.minimum(((centroid - low) * scale).astype(np.int32), bins - 1)
    return number


def _plane_costs(box: np.ndarray, key: np.ndarray, nodes: int, bins: int) -> np.ndarray:
    """Cost of splitting after each bin but the last, float32 (nodes, bins - 1); inf if a side stays empty."""
    number = np.bincount(key, minlength=nodes * bins).reshape(nodes, bins)
    flat = np.full((6, nodes * bins), np.inf, np.float32)
    for row in range(6):
        np.minimum.at(flat[row], key, box[row])
    binned = flat.reshape(6, nodes, bins)
    below = np.cumsum(number, axis=1)[:, :-1]
    above = number.sum(axis=1, keepdims=True) - below
    lower_area = half_area(np.minimum.accumulate(binned, axis=2))[:, :-1]
    upper_area = half_area(np.minimum.accumulate(binned[:, :, ::-1], axis=2))[:, -2::-1]
    cost = lower_area * -(-below // BVH_PACKET) + upper_area * -(-above // BVH_PACKET)
    return np.where((below > 0) & (above > 0), cost, np.inf).astype(np.float32)


def _divide(level: _Level) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Both halves of every node, side by side: the next level's order, boxes, starts; the halves' boxes."""
    nodes = len(level.start) - 1
    order, box = np.empty_like(level.order), np.empty_like(level.box)
    sizes = np.empty((nodes, 2), np.int64)
    for first, last in _chunks(level.start):
        here = slice(level.start[first], level.start[last])
        counts = np.diff(level.start[first : last + 1])
        node = np.repeat(np.arange(last - first, dtype=np.int32), counts)
        right = _on_the_right(level, first, last, node)
        rank = np.cumsum(right, dtype=np.int32)
        starts = (level.start[first:last] - level.start[first]).astype(np.int32)
        before = np.where(starts > 0, rank[starts - 1], 0).astype(np.int32)
        rank -= before[node]  # now: how many of the node's, up to here, go right
        in_node = np.arange(len(node), dtype=np.int32) - starts[node]
        rights = rank[starts + counts - 1]
        lefts = (counts - rights).astype(np.int32)
        target = starts[node] + np.where(right, lefts[node] + rank - 1, in_node - rank)
        order[here][target] = level.order[here]
        for row in range(6):
            box[row, here][target] = level.box[row, here]
        sizes[first:last, 0], sizes[first:last, 1] = lefts, rights
    start = np.concatenate(([0], np.cumsum(sizes.reshape(-1))))
    child_boxes = np.minimum.reduceat(box, start[:-1], axis=1) if nodes else np.empty((6, 0), np.float32)
    return order, box, start, child_boxes


def _on_the_right(level: _Level, first: int, last: int, node: np.ndarray) -> np.ndarray:
    """Which primitives of nodes first to last go to the right half."""
    starts, stop = level.start[first:last] - level.start[first], level.start[last] - level.start[first]
    here = slice(level.start[first], level.start[last])
    axis, plane = level.axis[first:last], level.plane[first:last]
    bins = _BINS if (last - first) * 64 < stop else _BINS // 2
    chosen = np.maximum(axis, 0)
    each, box = np.arange(last - first), level.box[:, here]
    lane = chosen[node]
    centroid = np.choose(lane, [box[a] - box[a + 3] for a in range(3)])
    low, scale = level.low[:, first:last][chosen, each], level.scale[:, first:last][chosen, each]
    right: np.ndarray = _bin_of(centroid, low[node], scale[node], bins) > plane[node]
    halved = np.flatnonzero(axis < 0)
    if len(halved):
        members = np.flatnonzero((axis < 0)[node])
        by_number = np.arange(len(node)) - starts[node] >= (np.diff(np.append(starts, stop)) // 2)[node]
        ranked = members[np.lexsort((_longest_centroid(box, starts, node)[members], node[members]))]
        right[ranked] = by_number[members]
    return right


def _longest_centroid(box: np.ndarray, starts: np.ndarray, node: np.ndarray) -> np.ndarray:
    """Doubled centroids along the axis in which those of a node differ most."""
    centroids = np.stack([box[a] - box[a + 3] for a in range(3)])
    extents = np.maximum.reduceat(centroids, starts, axis=1) - np.minimum.reduceat(centroids, starts, axis=1)
    longest: np.ndarray = np.choose(np.argmax(extents, axis=0)[node], centroids)
    return longest
