"""Rays through gaps between walls, of which a cell's mean says nothing: controls leave something to be seen.

False alarms: 1e-4 for each test, at fixed seeds.
"""

import numpy as np
import pytest
from fields import exit_distance
from probe import Probe, grid_volume, scene_of
from stat_tests import largest_z, z_score
from tiers import quick_first
from walks import sample_walks, transmittance_walks, unbiased

from clvol.accel.controls import LONGEST_GROWTH, control, residual
from clvol.planning import registry
from clvol.scene.records import ConstVolume, Medium

WALL, HAZE, WALKS = 300.0, 0.3, 1 << 15
GAP = np.array([0.01, 0.53, 0.53]), np.array([1.0, 0.0, 0.0])
LENGTH = exit_distance(*GAP)
EXACT = np.exp(-HAZE * LENGTH)
SEEN = 0.3
"""Error relative to the value that must have been noticed."""


def probe_with(device, wall=WALL, **choices):
    """A checkerboard of beams along x, dense as walls and thin as haze by turns."""
    z, y, _ = np.indices((16, 16, 16))
    values = np.where((y + z) % 2 == 0, HAZE, wall).astype(np.float32)
    medium = Medium(grid_volume(values, "nearest"), ConstVolume((0.5,)), (1.0,), homogeneous=False)
    return Probe(device, scene_of(medium), **choices)


def assert_seen(values, exact, comparisons):
    error = values.std(dtype=float) / np.sqrt(len(values)) + 1e-6 * exact
    bound = largest_z(comparisons)
    assert bound * error < SEEN * exact, f"{values.mean()} ± {error} does not tell {exact} from nothing"
    assert abs(z_score(values.mean(dtype=float), error**2, exact)) < bound


@quick_first("majorant", registry.MAJORANTS)
@quick_first("kind", registry.CONTROLS)
def test_residual_ratio_tracking_sees_through_a_gap(device, kind, majorant):
    probe = probe_with(device, transmittance="residual-ratio", control=kind, majorant=majorant)
    values, flaws, _ = transmittance_walks(probe, GAP, LENGTH, WALKS)
    assert flaws.sum() == 0
    assert_seen(values[:, 0], EXACT, 1)


@quick_first("transmittance", [t for t in unbiased("transmittance") if t != "residual-ratio"], count=2)
def test_every_transmittance_sees_through_a_gap(device, transmittance):
    probe = probe_with(device, transmittance=transmittance, majorant="grid")
    assert_seen(transmittance_walks(probe, GAP, LENGTH, WALKS // 8)[0][:, 0], EXACT, 1)


@quick_first("technique", unbiased("technique"), count=2)
def test_every_technique_passes_a_gap(device, technique):
    probe = probe_with(device, 10 * WALL, technique=technique, majorant="grid")
    t, weights, *_ = sample_walks(probe, GAP, LENGTH, WALKS // 8)
    assert_seen(np.where(t < 0, weights[:, 0], 0.0), EXACT, 1)


@pytest.mark.parametrize("longest", [(3.0,), (3.0, 0.1, 50.0)])
def test_no_control_lets_the_second_moment_grow_beyond_its_limit(longest):
    """At densities of the cells' minimum along the longest way, in closed form."""
    rng, longest = np.random.default_rng(4), np.array(longest)
    shape = 200, len(longest)
    low = (rng.random(shape) * (rng.random(shape) < 0.7)).astype(np.float32)
    high = low + (10 ** rng.uniform(-3, 5, shape)).astype(np.float32)
    mean = (low + rng.random(shape) * (high - low)).astype(np.float32)
    for kind in registry.CONTROLS:
        c, rate = residual(low, high, mean, kind, longest=longest)
        growth = longest**2 / longest.max() * (c.astype(float) - low) ** 2 / rate[:, None]
        assert growth.max() <= 1.001 * LONGEST_GROWTH
        assert (rate[:, None] >= np.maximum(high - c, c - low)).all()
    c = control(low, high, mean, "fitted", longest=longest)
    assert (8 * longest * (c.astype(float) - low)).max() <= 1.01 * LONGEST_GROWTH
    assert (c >= np.minimum(low, 0.9 * high.max(axis=-1, keepdims=True))).all()
