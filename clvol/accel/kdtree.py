"""Adaptive kd-tree of majorants (after Yue et al. 2010): the cheapest one, built in vectorised NumPy.

Every box that halving the lattice can make is weighed, smallest first: as one leaf, or split along x, y
or z into the best trees of its halves, whichever costs a random ray least.  By integral geometry
(clvol.accel.choice) a leaf costs its volume × looseness in look-ups and a quarter of its surface in visits;
a visit starts at the root, so that each split adds a step to every visit below it.  The looseness is the
technique's (clvol.accel.controls): the majorant, less the control that decomposition subtracts.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from clvol.accel.bounds import Bounds
from clvol.accel.controls import Control, looseness, scaled_majorant

MOST_CELLS = 64
"""Cells per axis of the finest lattice: all boxes of a 64³ lattice number 2 million."""
LEAF = -1

Key = tuple[int, int, int]
"""Halvings along z, y, x: level (a, b, c) has 2^a × 2^b × 2^c boxes."""


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


@dataclass(frozen=True)
class _Costs:
    """What boxes cost: see `build_kdtree`."""

    rate: float
    leaf: float
    step: float
    control: Control
    majorant_scale: float


class _Boxes(NamedTuple):
    """Extrema and perhaps means of boxes, float32 (..., channels)."""

    minimum: np.ndarray
    maximum: np.ndarray
    mean: np.ndarray | None


@dataclass(frozen=True, eq=False)
class _Level:
    """All boxes of one size, and for each the cheapest cost, its leaf visits, its split: (2^a, 2^b, 2^c)."""

    boxes: _Boxes
    cost: np.ndarray
    visits: np.ndarray
    split: np.ndarray  # axis 0 = z, 1 = y, 2 = x, or LEAF


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
    costs = _Costs(rate, leaf_cost, step_cost, control, majorant_scale)
    shape = bounds.maximum.shape[:3]
    depths: Key = tuple(int(n - 1).bit_length() for n in shape)
    edges = [extent * np.arange(n + 1) for extent, n in zip(cell_extent[::-1], shape, strict=True)]
    levels: dict[Key, _Level] = {}
    for key in sorted(product(*(range(d + 1) for d in depths)), key=sum, reverse=True):
        widths = [_widths(e, k, d) for e, k, d in zip(edges, key, depths, strict=True)]
        halves = {
            axis: levels[tuple(k + (a == axis) for a, k in enumerate(key))]
            for axis in range(3)
            if key[axis] < depths[axis]
        }
        if halves:
            axis, level = next(iter(halves.items()))
            boxes = _merged(level.boxes, axis, _widths(edges[axis], key[axis] + 1, depths[axis]))
        else:
            boxes = _padded(bounds, depths)
        levels[key] = _cheapest(boxes, widths, halves, costs)
    return _emit(levels, depths, majorant_scale)


def _widths(edges: np.ndarray, halvings: int, depth: int) -> np.ndarray:
    """World widths of the 2^halvings boxes along one axis; what reaches beyond the lattice counts as 0."""
    planes = np.arange((1 << halvings) + 1) << (depth - halvings)
    return np.diff(edges[np.minimum(planes, len(edges) - 1)])


def _padded(bounds: Bounds, depths: Key) -> _Boxes:
    """The lattice filled up to powers of two by cells that bound nothing."""
    pad = [(0, (1 << d) - n) for d, n in zip(depths, bounds.maximum.shape, strict=False)] + [(0, 0)]
    mean = None if bounds.mean is None else np.pad(bounds.mean, pad)
    return _Boxes(np.pad(bounds.minimum, pad, constant_values=np.inf), np.pad(bounds.maximum, pad), mean)


def _pairs(values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """The first and the second of each two neighbours along an axis."""
    even, odd = [slice(None)] * values.ndim, [slice(None)] * values.ndim
    even[axis], odd[axis] = slice(0, None, 2), slice(1, None, 2)
    return values[tuple(even)], values[tuple(odd)]


def _merged(boxes: _Boxes, axis: int, widths: np.ndarray) -> _Boxes:
    """Boxes of twice the length along an axis, where those of `boxes` have the given widths."""
    low = np.minimum(*_pairs(boxes.minimum, axis))
    high = np.maximum(*_pairs(boxes.maximum, axis))
    if boxes.mean is None:
        return _Boxes(low, high, None)
    near, far = _pairs(boxes.mean, axis)
    whole = widths[::2] + widths[1::2]
    share = np.divide(widths[1::2], whole, out=np.zeros_like(whole), where=whole > 0).astype(np.float32)
    # never beyond the two means, also after rounding: a constant box keeps its value
    return _Boxes(low, high, near + (far - near) * share.reshape([-1 if a == axis else 1 for a in range(4)]))


def _cheapest(boxes: _Boxes, widths: list[np.ndarray], halves: dict[int, _Level], costs: _Costs) -> _Level:
    """Weigh a leaf against a split along each axis that can still be halved."""
    w, h, d = widths[0][:, None, None], widths[1][None, :, None], widths[2][None, None, :]
    visits = np.where(w * h * d > 0, 0.5 * (w * h + h * d + d * w), 0.0)
    cost = w * h * d * costs.rate * looseness(boxes, costs.control, costs.majorant_scale)
    cost += costs.leaf * visits
    split = np.full(cost.shape, LEAF, np.int8)
    for axis, level in halves.items():
        below = np.add(*_pairs(level.visits, axis))
        apart = np.add(*_pairs(level.cost, axis)) + costs.step * below
        cheaper = apart < cost
        cost, visits = np.where(cheaper, apart, cost), np.where(cheaper, below, visits)
        split[cheaper] = axis
    return _Level(boxes, cost, visits, split)


def pack_maximum(high: np.ndarray) -> np.ndarray:
    """First word of a leaf: the maximum's bits with the two low ones set (rounds it up); 3 for an exact 0.

    Infinity would become a NaN and is refused; bounds of finite volumes never hold it.
    """
    high = np.asarray(high, np.float32)
    if not np.isfinite(high).all() or (high < 0).any():
        raise ValueError("majorants must be finite and not negative")
    bits = np.where(high > 0, high, np.float32(0)).view(np.uint32)
    return np.where(high > 0, np.maximum(bits, np.uint32(4)), bits) | np.uint32(3)


def unpack_maximum(words: np.ndarray) -> np.ndarray:
    """The float32 bound that the device reads from a leaf's first word."""
    words = np.ascontiguousarray(words, np.uint32)
    return np.where(words == 3, np.float32(0), words.view(np.float32))


def _emit(levels: dict[Key, _Level], depths: Key, majorant_scale: float) -> KdTree:
    """Nodes in breadth-first order, siblings side by side, and the leaves' rows, in the same order."""
    keys, at = np.zeros((1, 3), np.int64), np.zeros((1, 3), np.int64)  # frontier: level and place, z y x
    first, leaves, blocks, rows = 0, 0, [], []
    while len(at):
        split, boxes = _frontier(levels, keys, at)
        node = np.empty((len(at), 2), np.uint32)
        first += len(at)
        inner, leaf = split != LEAF, split == LEAF
        rows.append([None if values is None else values[leaf] for values in boxes])
        node[leaf, 0] = pack_maximum(scaled_majorant(boxes.maximum[leaf], majorant_scale))
        node[leaf, 1] = leaves + np.arange(np.count_nonzero(leaf))
        leaves += int(np.count_nonzero(leaf))
        axis = split[inner]
        pair = np.arange(len(axis))
        keys, at = np.repeat(keys[inner], 2, axis=0), np.repeat(at[inner], 2, axis=0)
        for side in (0, 1):
            keys[2 * pair + side, axis] += 1
            at[2 * pair + side, axis] = 2 * at[2 * pair + side, axis] + side
        plane = at[1::2][pair, axis] << (np.array(depths)[axis] - keys[1::2][pair, axis])
        node[inner, 0] = (plane.astype(np.uint32) << 2) | (2 - axis).astype(np.uint32)
        node[inner, 1] = first + 2 * pair.astype(np.uint32)
        blocks.append(node)
    minimum, maximum, mean = (
        None if part[0] is None else np.concatenate(part) for part in zip(*rows, strict=True)
    )
    cost = float(levels[0, 0, 0].cost[0, 0, 0])
    return KdTree(np.concatenate(blocks), minimum, maximum, mean, cost, leaves, len(blocks))


def _frontier(levels: dict[Key, _Level], keys: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, _Boxes]:
    """Splits of the boxes `at` of the levels `keys`, and those boxes, (n, channels)."""
    boxes = levels[0, 0, 0].boxes
    split = np.empty(len(at), np.int64)
    minimum = np.empty((len(at), boxes.minimum.shape[-1]), np.float32)
    maximum = np.empty_like(minimum)
    mean = None if boxes.mean is None else np.empty_like(minimum)
    unique, group = np.unique(keys, axis=0, return_inverse=True)
    for number, key in enumerate(unique):
        members = group.reshape(-1) == number
        level, place = levels[tuple(int(k) for k in key)], tuple(at[members].T)
        split[members] = level.split[place]
        maximum[members] = level.boxes.maximum[place]
        minimum[members] = np.minimum(level.boxes.minimum[place], maximum[members])  # inf beyond the lattice
        if mean is not None:
            mean[members] = level.boxes.mean[place]
    return split, _Boxes(minimum, maximum, mean)
