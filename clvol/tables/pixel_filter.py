"""The pixel filter as a distribution of sample offsets: nothing is splatted.

Offsets are drawn in proportion to the filter's magnitude.  Samples drawn where it is negative count
negatively, and all are scaled by what the magnitude integrates to, relative to the filter itself.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from clvol.scene.records import ReconstructionFilter

FILTER_BINS = 1024


def filter_cdf(rfilter: ReconstructionFilter) -> np.ndarray:
    """What offsets along one axis are drawn from, at FILTER_BINS + 1 even points of [-radius, radius].

    float32 (FILTER_BINS + 1,): the integral of the filter's magnitude up to there, from 0 to 1.  For a signed
    filter a second row follows with the integral of the filter itself, in the same units.  Within a bin
    the filter counts as constant.  The box needs none.
    """
    mass = np.diff(_integral(rfilter, np.linspace(-rfilter.radius, rfilter.radius, FILTER_BINS + 1)))
    rows = np.stack([np.abs(mass), mass]) if rfilter.signed else mass[None]
    sums = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(rows, axis=1)], axis=1)
    sums /= np.abs(mass).sum()
    return sums.astype(np.float32).reshape(-1)


def _integral(rfilter: ReconstructionFilter, x: np.ndarray) -> np.ndarray:
    """Integral of the filter up to each `x`, but for a constant and a factor; float64."""
    r = rfilter.radius
    if rfilter.kind == "tent":
        tent: np.ndarray = np.sign(x) * (np.abs(x) / r - 0.5 * (x / r) ** 2)
        return tent
    if rfilter.kind == "gaussian":  # cut at the radius and lowered to reach 0 there, as in Mitsuba
        scale = rfilter.stddev * math.sqrt(2)
        floor = math.exp(-((r / scale) ** 2))
        erf = np.array([math.erf(position / scale) for position in x])
        return 0.5 * scale * math.sqrt(math.pi) * erf - floor * x
    if rfilter.kind == "mitchell":
        mitchell: np.ndarray = np.sign(x) * _mitchell_integral(np.abs(x), rfilter.b, rfilter.c)
        return mitchell
    if rfilter.kind == "lanczos":
        nodes, weights = np.polynomial.legendre.leggauss(4)
        middle, half = (x[1:] + x[:-1]) / 2, (x[1:] - x[:-1]) / 2
        at = middle[:, None] + half[:, None] * nodes
        return np.concatenate([[0.0], np.cumsum((np.sinc(at) * np.sinc(at / r)) @ weights * half)])
    raise ValueError(f"no table for a {rfilter.kind} filter")


def _mitchell_integral(x: np.ndarray, b: float, c: float) -> np.ndarray:
    """Integral from 0 to x >= 0 of the piecewise cubic of Mitchell and Netravali (1988, eq. 8), times 6."""
    inner = np.polyint([12 - 9 * b - 6 * c, -18 + 12 * b + 6 * c, 0, 6 - 2 * b])
    outer = np.polyint([-b - 6 * c, 6 * b + 30 * c, -12 * b - 48 * c, 8 * b + 24 * c])
    beyond = np.polyval(outer, np.clip(x, 1, 2)) - np.polyval(outer, 1)
    whole: np.ndarray = np.polyval(inner, np.minimum(x, 1)) + beyond
    return whole
