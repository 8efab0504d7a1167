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
LANE_CELL_COST = 0.1
"""The same of walks side by side in lanes, which do not wait for memory.  The doubling of the cells that
it brings took 12 % off the seconds of a cloud and 22 % off those of wisps, at 4 and 6 % more variance."""
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
    bounds: AnyBounds,
    extent: np.ndarray,
    rate: float,
    control: Control = "none",
    majorant_scale: float = 1.0,
    cell_cost: float | None = None,
) -> float:
    """Expected cost of a grid: its look-ups, and half the surface of every cell (each face is shared).

    cell_cost : of crossing one, in look-ups; by default `visit_cost`.
    """
    visit = visit_cost(bounds) if cell_cost is None else cell_cost
    total = 0.0
    for cells, sides in bounds.groups():
        loose = looseness(cells, control, majorant_scale)
        a, b, c = (side * length for side, length in zip(sides, extent, strict=True))
        volume, surface = a * b * c, 0.5 * (a * b + b * c + c * a)
        surface = np.where(volume > 0, surface, 0.0)
        total += rate * float(np.sum(volume * loose))
        total += visit * float(np.broadcast_to(surface, loose.shape).sum())
    return total


def visit_cost(bounds: AnyBounds) -> float:
    """Crossing a cell of a grid, in look-ups; those of a sparse one are found from a root."""
    return CELL_COST if isinstance(bounds, Bounds) else LEAF_COST + STEP_COST * len(bounds.tiers)


def best_grid(
    bounds: AnyBounds,
    extent: np.ndarray,
    rate: float,
    control: Control = "none",
    majorant_scale: float = 1.0,
    in_lanes: bool = False,
) -> tuple[AnyBounds, float]:
    """The cheapest grid among `bounds` and its successive doublings, and its cost for walks one by one.

    in_lanes : the cheapest is that for walks in lanes.
    """
    technique = control, majorant_scale
    cell_cost = LANE_CELL_COST if in_lanes and isinstance(bounds, Bounds) else visit_cost(bounds)
    best, best_extent = bounds, extent
    least = grid_cost(bounds, extent, rate, *technique, cell_cost)
    while max(bounds.cells) > 1:
        bounds, extent = bounds.coarser(), extent * 2
        cost = grid_cost(bounds, extent, rate, *technique, cell_cost)
        if cost < least:
            best, best_extent, least = bounds, extent, cost
    return best, grid_cost(best, best_extent, rate, *technique) if in_lanes else least
