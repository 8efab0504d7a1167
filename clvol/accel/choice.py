"""Which majorant a medium gets: the expected cost of a ray through it, in look-ups, decides.

By integral geometry a random line through a convex body has mean chord 4V/A and meets a part of
surface a with probability a/A.  All costs below are therefore volume × bound for look-ups plus a
quarter of the surface for visits, and may be compared with each other.
"""

from __future__ import annotations

import numpy as np

from clvol.accel.bounds import Bounds

CELL_COST = 0.055
"""Crossing a grid cell, in look-ups: fitted to the seconds of camera rays through scenes/cloud.xml over
cells of 4 to 128 voxels, on PoCL and a Zen 3 core (a look-up took 56 ns, a crossing 3 ns)."""
LEAF_COST = 0.35
STEP_COST = 0.08
"""Visiting a kd-tree leaf, and one step towards it from the root: of the pairs tried there, the one whose
tree was walked fastest."""


def global_cost(bounds: Bounds, extent: np.ndarray, rate: float) -> float:
    """Expected cost of one bound for everything."""
    return float(np.prod(np.array(bounds.cells) * extent)) * rate * float(bounds.maximum.max())


def grid_cost(bounds: Bounds, extent: np.ndarray, rate: float) -> float:
    """Expected cost of a grid: its look-ups, and half the surface of every cell (each face is shared)."""
    volume = float(np.prod(extent))
    a, b, c = extent
    crossings = bounds.maximum.size * 0.5 * (a * b + b * c + c * a)
    return volume * rate * float(bounds.maximum.sum(dtype=np.float64)) + CELL_COST * crossings


def best_grid(bounds: Bounds, extent: np.ndarray, rate: float) -> tuple[Bounds, float]:
    """The cheapest grid among `bounds` and its successive doublings, and its cost."""
    best, best_cost = bounds, grid_cost(bounds, extent, rate)
    while max(bounds.cells) > 1:
        bounds, extent = bounds.coarser(), extent * 2
        cost = grid_cost(bounds, extent, rate)
        if cost < best_cost:
            best, best_cost = bounds, cost
    return best, best_cost
