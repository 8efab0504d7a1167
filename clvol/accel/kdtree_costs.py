"""What kd-trees of majorants cost: every box that halving lattices can make is weighed, smallest first.

A box may be one leaf, or split along z, y or x into the best trees of its halves, whichever costs a random
ray least (clvol.accel.kdtree).  Any number of lattices of one size are weighed together.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from clvol.accel.cells import Cells
from clvol.accel.controls import Control, looseness
from clvol.base.types import triple

LEAF, DEEPER = -1, 3
"""What a box is where it is not split along an axis: a leaf, or a tree of its own within a finest box."""

Key = tuple[int, int, int]
"""Halvings along z, y, x: level (a, b, c) has 2^a × 2^b × 2^c boxes."""


@dataclass(frozen=True)
class Costs:
    """What boxes cost: see `build_kdtree`."""

    rate: float
    leaf: float
    step: float
    control: Control
    majorant_scale: float


class Within(NamedTuple):
    """Trees within the finest boxes: their cost, infinite where there is none, and leaf visits."""

    cost: np.ndarray
    visits: np.ndarray


@dataclass(frozen=True, eq=False)
class Level:
    """All boxes of one size in n lattices, and for each the cheapest cost, its leaf visits, its split.

    Arrays are (n, 2^a, 2^b, 2^c).
    """

    boxes: Cells
    cost: np.ndarray
    visits: np.ndarray
    split: np.ndarray  # axis 0 = z, 1 = y, 2 = x, or LEAF, or DEEPER


def weigh(
    finest: Cells, edges: list[np.ndarray], depths: Key, costs: Costs, within: Within | None = None
) -> dict[Key, Level]:
    """The cheapest tree over every box of n lattices of 2^depths cells.

    finest : their cells, (n, 2^a, 2^b, 2^c, channels).  within : trees that a cell may be split by, if any.
    edges : along z, y, x the world positions of the cells' planes, float64 (n or 1, 2^d + 1).
    """
    levels: dict[Key, Level] = {}
    for halvings in sorted(product(*(range(d + 1) for d in depths)), key=sum, reverse=True):
        key = triple(halvings)
        widths = [_widths(e, k, d) for e, k, d in zip(edges, key, depths, strict=True)]
        halves = {
            axis: levels[triple(k + (a == axis) for a, k in enumerate(key))]
            for axis in range(3)
            if key[axis] < depths[axis]
        }
        if halves:
            axis, level = next(iter(halves.items()))
            boxes = _merged(level.boxes, axis, _widths(edges[axis], key[axis] + 1, depths[axis]))
        else:
            boxes = finest
        levels[key] = _cheapest(boxes, widths, halves, None if halves else within, costs)
    return levels


def _widths(edges: np.ndarray, halvings: int, depth: int) -> np.ndarray:
    """World widths of the 2^halvings boxes along one axis; what reaches beyond the lattice counts as 0."""
    return np.diff(edges[:, :: 1 << (depth - halvings)], axis=1)


def _pairs(values: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """The first and the second of each two neighbours along an axis of the lattices."""
    even, odd = [slice(None)] * values.ndim, [slice(None)] * values.ndim
    even[axis + 1], odd[axis + 1] = slice(0, None, 2), slice(1, None, 2)
    return values[tuple(even)], values[tuple(odd)]


def _along(widths: np.ndarray, axis: int) -> np.ndarray:
    """Numbers per lattice and place along one axis, (n, k), as an array of boxes."""
    return widths.reshape([len(widths), *(-1 if a == axis else 1 for a in range(3))])


def _merged(boxes: Cells, axis: int, widths: np.ndarray) -> Cells:
    """Cells of twice the length along an axis, where those of `boxes` have the given widths."""
    low = np.minimum(*_pairs(boxes.minimum, axis))
    high = np.maximum(*_pairs(boxes.maximum, axis))
    if boxes.mean is None:
        return Cells(low, high, None)
    near, far = _pairs(boxes.mean, axis)
    whole = widths[:, ::2] + widths[:, 1::2]
    share = np.divide(widths[:, 1::2], whole, out=np.zeros_like(whole), where=whole > 0).astype(np.float32)
    # never beyond the two means, also after rounding: a constant box keeps its value
    return Cells(low, high, near + (far - near) * _along(share, axis)[..., None])


def _cheapest(
    boxes: Cells,
    widths: list[np.ndarray],
    halves: dict[int, Level],
    within: Within | None,
    costs: Costs,
) -> Level:
    """Weigh a leaf against a split along each axis that can still be halved, and a cell's own tree."""
    w, h, d = (_along(of_axis, axis) for axis, of_axis in enumerate(widths))
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
    if within is not None:
        cheaper = within.cost < cost
        cost, visits = np.where(cheaper, within.cost, cost), np.where(cheaper, within.visits, visits)
        split[cheaper] = DEEPER
    return Level(boxes, cost, visits, split)
