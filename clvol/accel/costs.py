"""Which majorant a medium gets: the expected cost of a ray through it, in look-ups, decides.

By integral geometry a random line through a convex body has mean chord 4V/A and meets a part of
surface a with probability a/A.  All costs below are therefore volume × looseness (the bound less the
control that a technique subtracts from it) for look-ups plus a quarter of the surface for visits, and may
be compared with each other.
"""

from __future__ import annotations

import numpy as np

from clvol.accel.bounds import Bounds
from clvol.accel.controls import Control, looseness
from clvol.accel.sparse_bounds import SparseBounds

CELL_COST = 0.055
"""Crossing a grid cell, in look-ups: fitted to the seconds of camera rays through scenes/cloud.xml over
cells of 4 to 128 voxels, on PoCL and a Zen 3 core (a look-up took 56 ns, a crossing 3 ns)."""
LEAF_COST = 0.35
STEP_COST = 0.08
"""Visiting a kd-tree leaf, and one step towards it from the root: of the pairs tried there, the one whose
tree was walked fastest."""

AnyBounds = Bounds | SparseBounds


def global_cost(
    bounds: AnyBounds, extent: np.ndarray, rate: float, control: Control = "none", majorant_scale: float = 1.0
) -> float:
    """Expected cost of one bound for everything.

    extent : float64 (3,), world lengths of a cell of `bounds` along x, y, z.
    rate : look-ups per world length and unit of the bound: the medium's largest scale.
    control, majorant_scale : what the technique subtracts (clvol.accel.controls).
    """
    loose = float(looseness(bounds.whole(), control, majorant_scale)[0, 0, 0])
    return float(np.prod(np.array(bounds.cells) * extent)) * rate * loose


def grid_cost(
    bounds: AnyBounds, extent: np.ndarray, rate: float, control: Control = "none", majorant_scale: float = 1.0
) -> float:
    """Expected cost of a grid: its look-ups, and half the surface of every cell (each face is shared)."""
    total = 0.0
    for cells, sides in bounds.groups():
        loose = looseness(cells, control, majorant_scale)
        a, b, c = (side * length for side, length in zip(sides, extent, strict=True))
        volume, surface = a * b * c, 0.5 * (a * b + b * c + c * a)
        surface = np.where(volume > 0, surface, 0.0)
        total += rate * float(np.sum(volume * loose))
        total += visit_cost(bounds) * float(np.broadcast_to(surface, loose.shape).sum())
    return total


def visit_cost(bounds: AnyBounds) -> float:
    """Crossing a cell of a grid, in look-ups; those of a sparse one are found from a root."""
    return CELL_COST if isinstance(bounds, Bounds) else LEAF_COST + STEP_COST * len(bounds.tiers)


def best_grid(
    bounds: AnyBounds, extent: np.ndarray, rate: float, control: Control = "none", majorant_scale: float = 1.0
) -> tuple[AnyBounds, float]:
    """The cheapest grid among `bounds` and its successive doublings, and its cost."""
    best, best_cost = bounds, grid_cost(bounds, extent, rate, control, majorant_scale)
    while max(bounds.cells) > 1:
        bounds, extent = bounds.coarser(), extent * 2
        cost = grid_cost(bounds, extent, rate, control, majorant_scale)
        if cost < best_cost:
            best, best_cost = bounds, cost
    return best, best_cost
