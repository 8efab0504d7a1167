"""Exact flights: where the integral of a cubic reaches a depth, to the last digits however near its start."""

import numpy as np
import pytest
from fields import sparse
from probe import Probe, medium_of, scene_of

RATES = [1.0, 3.7, 1e3, 1e6]
CUBICS = {
    "constant": (1.0, 0.0, 0.0, 0.0),
    "rising": (0.5, 0.25, 0.0, 0.0),
    "bent": (0.3, 0.1, -0.02, 0.002),
}


@pytest.fixture(scope="module")
def probe(device):
    return Probe(device, scene_of(medium_of(sparse((8, 8, 8)), 5.0)), technique="regular")


@pytest.mark.parametrize("shape", CUBICS)
def test_a_depth_is_reached_where_it_is_reached_however_thick_the_cell(probe, shape):
    """A step of Newton's that changes nothing is the end, not a step out of bounds."""
    depths = np.geomspace(1e-7, 1.0, 400)
    terms = np.array([[*np.multiply(CUBICS[shape], rate), d] for rate in RATES for d in depths], np.float32)
    out = np.zeros(len(terms), np.float32)
    body = """
        Cubic cubic = {in0[5 * i], in0[5 * i + 1], in0[5 * i + 2], in0[5 * i + 3]};
        out0[i] = invert_cubic(&cubic, 0, in0[5 * i + 4]);"""
    probe.run(["tracking/regular.h"], body, [out], [terms])
    a, b, c, d, target = terms.astype(float).T
    exact = target / a
    for _ in range(60):
        integral = exact * (a + exact * (b / 2 + exact * (c / 3 + exact * d / 4)))
        exact -= (integral - target) / (a + exact * (b + exact * (c + exact * d)))
    assert np.abs(out / exact - 1).max() < 3e-6
