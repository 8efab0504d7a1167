"""The pixel filter as a distribution of sample offsets: nothing is splatted, weights stay 1."""

from __future__ import annotations

import math

import numpy as np

from clvol.scene.records import ReconstructionFilter

FILTER_BINS = 1024


def filter_cdf(rfilter: ReconstructionFilter) -> np.ndarray:
    """Cumulative distribution of the filter along one axis at FILTER_BINS + 1 even points of
    [-radius, radius]; float32, from 0 to 1.  The box needs none."""
    edges = np.linspace(-rfilter.radius, rfilter.radius, FILTER_BINS + 1)
    r = rfilter.radius
    if rfilter.kind == "tent":
        mass = 0.5 + np.sign(edges) * (np.abs(edges) / r - 0.5 * (edges / r) ** 2)
    elif rfilter.kind == "gaussian":  # cut at the radius and lowered to reach 0 there, as in Mitsuba
        scale = rfilter.stddev * math.sqrt(2)
        floor = math.exp(-((r / scale) ** 2))
        erf = np.array([math.erf(x / scale) for x in edges])
        mass = 0.5 * scale * math.sqrt(math.pi) * erf - floor * edges
    else:
        raise ValueError(f"no table for a {rfilter.kind} filter")
    mass = (mass - mass[0]) / (mass[-1] - mass[0])
    return mass.astype(np.float32)
