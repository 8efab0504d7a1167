"""Estimators broken on purpose: the comparisons of the contract must catch each of them."""

import numpy as np
import pytest
from fields import RAYS, exit_distance
from pictures import assert_matches, box, gridded, picture, volume
from probe import Probe, medium_of, scene_of
from stat_tests import FALSE_ALARM, largest_z, z_score
from walks import (
    BINS,
    collision_p_value,
    exact_depth,
    sample_walks,
    scene_with,
    transmittance_walks,
    weighted_z,
)

from clvol import render
from clvol.device import programs
from clvol.scene.records import ConstantEmitter
from clvol.volumes import bricks

WALKS = 1 << 18
RAY = RAYS["oblique"]
LENGTH = exit_distance(*RAY)
SKY = np.float32([1.0, 0.999, 1.0])
"""What the device has of it: samples are so even that they tell it from 0.999."""


@pytest.fixture
def mutate(monkeypatch):
    """Replaces a piece of a kernel's text; it must be there."""

    def replace(name, old, new):
        original = programs.kernel_source

        def source(wanted):
            text = original(wanted)
            if wanted != name:
                return text
            assert old in text, f"{name} no longer says {old!r}"
            return text.replace(old, new)

        monkeypatch.setattr(programs, "kernel_source", source)

    return replace


def ratio_z(device):
    scene = scene_with("ramp")
    probe = Probe(device, scene, transmittance="ratio", technique="weighted-delta", majorant_scale=0.4)
    values = transmittance_walks(probe, RAY, LENGTH, WALKS)[0][:, 0].astype(float)
    exact = np.exp(-exact_depth("ramp", "oblique")[0, -1])
    return abs(z_score(values.mean(), values.var() / WALKS, exact))


def test_a_clamped_ratio_is_caught(device, mutate):
    assert ratio_z(device) < largest_z(1)
    mutate(
        "tracking/ratio.h", "(majorant - sigma_t) / majorant", "max_of((majorant - sigma_t) / majorant, 0.0f)"
    )
    assert ratio_z(device) > largest_z(1)


def signed_z(device):
    probe = Probe(device, scene_with("ramp"), technique="weighted-delta", majorant_scale=0.4)
    t, weights, *_ = sample_walks(probe, RAY, LENGTH, WALKS)
    return weighted_z(t, weights[:, 0], exact_depth("ramp", "oblique")[0], LENGTH).max()


def test_a_dropped_weight_sign_is_caught(device, mutate):
    assert signed_z(device) < largest_z(BINS + 1)
    mutate("tracking/weighted.h", "event_weight(sigma_n,", "event_weight(abs_of(sigma_n),")
    assert signed_z(device) > largest_z(BINS + 1)


def chromatic_furnace():
    lower, upper = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
    values = np.random.default_rng(3).uniform(0.0, 1.0, (6, 5, 4)) ** 2
    medium = gridded(volume(values, lower, upper), 1.0, scale=(3.0, 1.5, 0.5))
    eye = (0.5, 0.8, -4.0)
    scene = picture(
        [box(lower, upper, medium)], (ConstantEmitter(tuple(SKY.tolist())),), eye, (0, 0, 0), 24.0, (4, 4)
    )
    return render(scene, spp=1 << 13, seed=1, technique="spectral")


def test_a_weight_reset_at_the_exit_is_caught(mutate):
    assert_matches(chromatic_furnace(), SKY)
    mutate(
        "stages/medium_sample.h",
        "    record_walk(scene, slot, tally, collision.beta, collision.emission);",
        "    const Spectrum kept = collided ? collision.beta : path_beta(scene, slot);\n"
        "    record_walk(scene, slot, tally, kept, collision.emission);",
    )
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(chromatic_furnace(), SKY)


def test_a_halo_left_out_is_caught(device, monkeypatch):
    """Extrema of each cell's own samples only: interpolated values exceed them, and free flights go wrong."""

    def without_halo(samples, axis, combine):
        count = (samples.shape[axis] - 1) // bricks.BOUND_CELLS
        starts = np.arange(count) * bricks.BOUND_CELLS
        inner = np.take(samples, range(count * bricks.BOUND_CELLS), axis=axis)
        return combine.reduceat(inner, starts, axis=axis)

    def flights():
        probe = Probe(device, scene_with("sparse"), technique="delta", majorant="grid")
        t, _, _, flaws, _ = sample_walks(probe, RAY, LENGTH, 1 << 20)
        return collision_p_value(t, exact_depth("sparse", "oblique")[0], LENGTH), int(flaws.sum())

    p_value, flaws = flights()
    assert p_value > FALSE_ALARM and flaws == 0
    monkeypatch.setattr(bricks, "half_extrema", without_halo)
    p_value, flaws = flights()
    assert p_value < FALSE_ALARM and flaws > 0


def test_a_majorant_too_low_by_a_tenth_is_caught(device):
    """Violations are counted, and the distribution test rejects what delta tracking makes of it."""
    probe = Probe(
        device, scene_of(medium_of(np.full((9, 8, 10), 0.7), 1.5)), majorant="grid", technique="delta"
    )
    for majorant in probe.prepared.majorants:
        majorant.majorant[...] *= np.float32(0.9)
    probe.upload()
    t, _, _, flaws, _ = sample_walks(probe, RAY, LENGTH, WALKS)
    assert flaws.sum() > 0
    assert collision_p_value(t, exact_depth("constant", "oblique")[0], LENGTH) < FALSE_ALARM
