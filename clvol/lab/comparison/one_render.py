"""The error of one render over its samples: what a user who renders longer gains."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import stdtrit

from clvol.lab.comparison.measure import Rounds
from clvol.lab.efficiency import error_products

if TYPE_CHECKING:
    from clvol.lab.comparison.measure import Measured
    from clvol.lab.comparison.reference import Reference


class OneRender(NamedTuple):
    """Means over independent renders of each length, the shortest first; float64 (lengths,) each.

    spp : samples a pixel.  seconds, lookups : of one render, precomputation apart.
    relmse : relative MSE of one render; low, high : ends of its 95 % interval, Student's, the reference's own
        error left out.
    """

    spp: np.ndarray
    seconds: np.ndarray
    lookups: np.ndarray
    relmse: np.ndarray
    low: np.ndarray
    high: np.ndarray


def one_render(measured: Measured, reference: Reference, weight: np.ndarray) -> OneRender:
    """From the rounds and the shorter renders; `weight` makes a squared error relative."""
    longest = Rounds(measured.images, measured.seconds, measured.lookups)
    lengths = sorted({**measured.shorter, measured.spp: longest}.items())
    rows = []
    for spp, made in lengths:
        errors = np.diag(error_products(made.images, reference.image, reference.variance, weight))
        mean, count = errors.mean(), len(errors)
        reach = stdtrit(count - 1, 0.975) * errors.std(ddof=1) / np.sqrt(count)
        rows.append((spp, made.seconds.mean(), made.lookups.mean(), mean, mean - reach, mean + reach))
    return OneRender(*np.array(rows, np.float64).T)
