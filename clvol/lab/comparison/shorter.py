"""How the error of one render falls with its samples: every combination also renders with fewer."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from clvol.lab.statistics import Interval

if TYPE_CHECKING:
    from collections.abc import Mapping

_FACTOR, _STEPS, _LEAST = 4, 2, 4


def shorter_spp(spp: int) -> tuple[int, ...]:
    """Samples of the shorter renders: a quarter of `spp`, a sixteenth and so on, down to one."""
    counts = []
    while (spp := spp // _FACTOR) >= 1:
        counts.append(spp)
    return tuple(counts)


def slope_spp(spp: int) -> tuple[int, ...]:
    """Those that the slope at `spp` is told from: a quarter and a sixteenth, if they are 4 or more."""
    return tuple(count for count in shorter_spp(spp)[:_STEPS] if count >= _LEAST)


def render_slope(errors: Mapping[int, np.ndarray], level: float = 0.95) -> Interval:
    """Slope of log(MSE) of one render over log(samples), with Student's interval; nan where it is unknown.

    Least squares, weighted by the numbers of renders, whose relative spread is taken to be the same at all
    numbers of samples.  The reference's own error, common to all, is not in the interval.

    Parameters
    ----------
    errors : squared error of each of some independent renders, float64 (renders,), by samples a render.
    """
    counts = np.array([len(e) for e in errors.values()], np.float64)
    means = np.array([e.mean() for e in errors.values()])
    freedom = counts.sum() - len(counts)
    if len(errors) < 2 or freedom < 1 or not (means > 0).all():
        return Interval(math.nan, math.nan, math.nan)
    squares = sum(((e / e.mean() - 1) ** 2).sum() for e in errors.values())
    x = np.log(np.array(list(errors), np.float64))
    away = counts * (x - np.average(x, weights=counts))
    slope = float(away @ np.log(means) / (away @ x))
    reach = float(stdtrit(freedom, (1 + level) / 2) * math.sqrt(squares / freedom / (away @ x)))
    return Interval(slope, slope - reach, slope + reach)
