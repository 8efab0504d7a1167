"""Adaptive kd-tree of majorants (after Yue et al. 2010), built bottom-up in vectorised NumPy.

The lattice is halved along its longest side again and again; going back up, two children stay apart
only where that lowers the expected cost of a ray through them: look-ups (volume × bound, since a ray's
mean chord is 4V/A) plus node visits (a quarter of the surface, the chance that a ray comes by).
Deciding bottom-up weighs every subtree exactly, so that no split is refused for paying only further down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.accel.bounds import Bounds


@dataclass(frozen=True, eq=False)
class KdTree:
    """nodes : uint32 (n, 2), the layout of cl/majorant/kdtree.h, root first.  cost : expected cost of a
    ray that crosses the whole box, in look-ups, times a quarter of the box's surface."""

    nodes: np.ndarray
    cost: float
    leaves: int
    depth: int


@dataclass(frozen=True, eq=False)
class _Level:
    """One level of the halving: bounds, cost and choice per node, and the axis its children split."""

    minimum: np.ndarray
    maximum: np.ndarray
    cost: np.ndarray
    split: np.ndarray
    axis: int


def build_kdtree(
    bounds: Bounds,
    cell_extent: np.ndarray,
    lookup_rate: float,
    visit_cost: float,
) -> KdTree:
    """Build the cheapest tree over the cells of `bounds`.

    Parameters
    ----------
    bounds : extrema per cell, float32 (nz, ny, nx), in density units.
    cell_extent : float64 (3,), world lengths of a cell along x, y, z.
    lookup_rate : float, expected look-ups per world length and unit of (maximum): the medium's scale.
    visit_cost : cost of visiting a node, in look-ups.
    """
    levels, shape = _build_levels(bounds, np.asarray(cell_extent, np.float64), float(lookup_rate), visit_cost)
    nodes, leaves, depth = _emit(levels, shape)
    return KdTree(nodes, float(levels[0].cost.reshape(-1)[0]), leaves, depth)


def _build_levels(
    bounds: Bounds, extent: np.ndarray, rate: float, visit_cost: float
) -> tuple[list[_Level], tuple[int, int, int]]:
    """Levels from the root down; the lattice is padded (by its border) to powers of two."""
    shape = tuple(1 << int(n - 1).bit_length() for n in bounds.maximum.shape)
    pad = [(0, s - n) for s, n in zip(shape, bounds.maximum.shape, strict=True)]
    low = np.pad(bounds.minimum, pad, mode="edge")
    high = np.pad(bounds.maximum, pad, mode="edge")
    size = np.ones(3)  # node edges in cells, z y x
    steps = _halvings(shape, extent[::-1])
    cost = _leaf_cost(high, size, extent, rate, visit_cost)
    levels = [_Level(low, high, cost, np.zeros(cost.shape, bool), -1)]
    for axis in reversed(steps):
        size[axis] *= 2
        low, high = _pairs(low, axis, np.minimum), _pairs(high, axis, np.maximum)
        whole = _leaf_cost(high, size, extent, rate, visit_cost)
        apart = _pairs(cost, axis, np.add) + _visit(size, extent, visit_cost)
        cost = np.minimum(whole, apart)
        levels.append(_Level(low, high, cost, apart < whole, axis))
    return levels[::-1], shape


def _halvings(shape: tuple[int, ...], extent: np.ndarray) -> list[int]:
    """Axes (0 = z) in the order they are halved: always the longest side in the world."""
    count = np.array(shape)
    steps = []
    while (count > 1).any():
        axis = int(np.argmax(np.where(count > 1, count * extent, -1.0)))
        steps.append(axis)
        count[axis] //= 2
    return steps


def _pairs(values: np.ndarray, axis: int, combine: np.ufunc) -> np.ndarray:
    even = [slice(None)] * 3
    odd = [slice(None)] * 3
    even[axis], odd[axis] = slice(0, None, 2), slice(1, None, 2)
    return combine(values[tuple(even)], values[tuple(odd)])


def _visit(size: np.ndarray, extent: np.ndarray, visit_cost: float) -> float:
    a, b, c = size * extent[::-1]
    return visit_cost * 0.5 * (a * b + b * c + c * a)


def _leaf_cost(
    high: np.ndarray, size: np.ndarray, extent: np.ndarray, rate: float, visit_cost: float
) -> np.ndarray:
    volume = float(np.prod(size * extent[::-1]))
    return volume * rate * high.astype(np.float64) + _visit(size, extent, visit_cost)


def pack_maximum(high: np.ndarray) -> np.ndarray:
    """First word of a leaf: the maximum's bits with the two low ones set (rounds it up); 3 for an exact 0.

    Infinity would become a NaN and is refused; bounds of finite volumes never hold it.
    """
    high = np.asarray(high, np.float32)
    if not np.isfinite(high).all() or (high < 0).any():
        raise ValueError("majorants must be finite and not negative")
    bits = np.where(high > 0, high, np.float32(0)).view(np.uint32)
    return np.where(high > 0, np.maximum(bits, np.uint32(4)), bits) | np.uint32(3)


def _emit(levels: list[_Level], shape: tuple[int, int, int]) -> tuple[np.ndarray, int, int]:
    """Nodes in breadth-first order, siblings side by side, and the numbers of leaves and levels.

    Nodes that lie in the padding are kept: no cell of the lattice leads to them.
    """
    at = np.zeros((1, 3), np.int64)  # the frontier: node coordinates at this level, z y x
    size = np.array(shape)
    first, blocks, leaves = 0, [], 0
    for level in levels:
        z, y, x = at.T
        split = level.split[z, y, x]
        node = np.empty((len(at), 2), np.uint32)
        node[:, 0] = pack_maximum(level.maximum[z, y, x])
        node[:, 1] = level.minimum[z, y, x].view(np.uint32)
        first += len(at)
        leaves += int(np.count_nonzero(~split))
        blocks.append(node)
        if not split.any():
            break
        size[level.axis] //= 2
        children = np.repeat(at[split], 2, axis=0)
        children[:, level.axis] = 2 * children[:, level.axis] + np.tile([0, 1], len(children) // 2)
        plane = children[1::2, level.axis] * size[level.axis]
        node[split, 0] = (plane.astype(np.uint32) << 2) | np.uint32(2 - level.axis)
        node[split, 1] = first + 2 * np.arange(len(plane), dtype=np.uint32)
        at = children
    return np.concatenate(blocks), leaves, len(blocks)
