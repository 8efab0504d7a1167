"""How many steps a walk may take before it is through a cell, or collides in it."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.accel.bounds import over_channels
from clvol.errors import OptionError, SceneError, Told, option

if TYPE_CHECKING:
    from clvol.accel.bounds import Bounds
    from clvol.accel.sparse_bounds import SparseBounds

log = logging.getLogger("clvol")

MOST_STEPS = 2**26
"""A walk is given up after so many: WALK_STEPS · WALK_LEGS of cl/tracking/interface.h."""
MANY_STEPS = 2**20
"""Steps of one walk that take about a hundredth of a second."""


def worst_cell(bounds: Bounds | SparseBounds, extent: np.ndarray, rate: float, scale: float = 1.0) -> float:
    """Tentative collisions that a walk has to expect in the worst cell, before it is through or collides.

    At most the optical depth of the bound along the cell's diagonal, and, by the geometric distribution of
    those that come before a real one, the bound over the least density.  Coarser majorants are looser.

    Parameters
    ----------
    extent : float64 (3,), world lengths of a cell of the lattice.  rate : what the density is multiplied by.
    scale : what the bounds are multiplied by.
    """
    worst = 0.0
    for cells, sides in bounds.groups():
        high = scale * over_channels(cells.maximum, np.maximum).astype(np.float64)
        low = over_channels(cells.minimum, np.minimum).astype(np.float64)
        squares = [np.square(side * length) for side, length in zip(sides, extent, strict=True)]
        through = high * rate * np.sqrt(squares[0] + squares[1] + squares[2])
        with np.errstate(divide="ignore", invalid="ignore"):
            before = np.where(low > 0, high / low, np.inf)
        worst = max(worst, float(np.minimum(through, before).max(where=high > 0, initial=0.0)))
    return worst


@dataclass(frozen=True)
class Worst:
    """Where walks through a medium whose extinction reaches `largest` take the most steps.

    steps : with bounds that are multiplied by `scale`.
    """

    where: str
    largest: float
    steps: float
    classified: bool
    scale: float = 1.0

    def check(self) -> None:
        """An error where walks would be given up, and a warning where they would take very long."""
        if self.steps < MANY_STEPS:
            return
        if (bearable := self.scale * MANY_STEPS / self.steps) >= 1 and self.scale > 1:
            self._check_scale(bearable)
            return
        enough = self.largest * MANY_STEPS / self.steps
        advice = f"{enough:.1g} looks as solid: lower the scale or the opacity"
        if not self.classified:
            advice += f", or use {option('technique', 'regular')} with {option('transmittance', 'regular')}"
        what = (
            f"its extinction goes from next to nothing to {self.largest:.3g}, and walks there have some "
            f"{self.steps:.2g} tentative collisions"
        )
        if self.steps > MOST_STEPS:
            raise SceneError(f"{what}; they are given up after {MOST_STEPS:.2g}", self.where, advice)
        log.warning(Told(f"%s: {what}; {advice}"), self.where)

    def _check_scale(self, bearable: float) -> None:
        """The same where it is the bounds' scale that makes walks long."""
        given = option("majorant_scale", self.scale)
        what = f"{given} makes walks of some {self.steps:.2g} tentative collisions"
        advice = f"up to {bearable:.1g} they are quick"
        if self.steps > MOST_STEPS:
            raise OptionError(f"{what}, which are given up after {MOST_STEPS:.2g}", self.where, advice)
        log.warning(Told(f"%s: {what}; {advice}"), self.where)
