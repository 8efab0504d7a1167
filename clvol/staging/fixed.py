"""What is chosen for a volume once, and kept for all frames of a sequence."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from clvol.staging.up import guess_up

if TYPE_CHECKING:
    from types import SimpleNamespace

    from clvol.staging.medium import Grids, Scales
    from clvol.staging.source import Source


@dataclass(frozen=True, eq=False)
class Fixed:
    """What all frames of a sequence share.

    Parameters
    ----------
    points : (n, 3), the outermost of what is seen in the world.
    up : the axis, and why.
    burns, flames : whether anything glows, and whether flames say what.
    peak : the greatest temperature.
    scales : what the values of the grids are multiplied by; None to choose them.
    limits : least and greatest value of the density, where something is made of its values.
    """

    points: np.ndarray
    up: tuple[str, str]
    burns: bool
    flames: bool
    peak: float
    scales: Scales | None = None
    limits: tuple[float, float] | None = None

    @classmethod
    def of(cls, source: Source, grids: Grids, options: SimpleNamespace) -> Fixed:
        """Of one volume."""
        up = (options.up, "") if options.up else guess_up(source.path)
        heat = grids.heat.peak if grids.burns and grids.heat is not None else 0.0
        limits = grids.density.limits if grids.density.look else None
        return cls(shown_points(grids), up, grids.burns, grids.flame is not None, heat, limits=limits)

    @property
    def box(self) -> np.ndarray:
        """Box (2, 3) round the points."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])


def shown_points(grids: Grids) -> np.ndarray:
    """The outermost points (n, 3) in the world of what is seen; the unit cube's where that is nothing."""
    if grids.density.empty:
        return np.array(list(product((0.0, 1.0), repeat=3)))
    return grids.density.outermost()
