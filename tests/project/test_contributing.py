"""The worked example of a technique in docs/contributing.md compiles, is right, and shows so in `clvol ray`.

Where it is too noisy to be judged, the tests of techniques say so.
"""

import re

import numpy as np
import pytest
from fields import FIELDS, RAYS, exit_distance
from places import ROOT
from probe import Probe, medium_of, scene_of
from slabs import assert_a_white_slab_loses_nothing
from stat_tests import TooNoisyError, largest_z
from walks import assert_weighted_collisions, exact_depth, sample_walks, scene_with

import clvol
from clvol.device import programs
from clvol.planning import registry

TEXT = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")
STEPS = TEXT.split("## Adding a technique")[1].split("\n## ")[0]
[EXAMPLE] = re.findall(r"```c\n(.*?)```", STEPS, re.DOTALL)
DOUBLED, DROPPED = "beta *= 2.0f", "beta *= 1.0f"


@pytest.fixture
def register(monkeypatch):
    """Adds the example as a reader would, changed or not; gives its name."""

    def add(header=EXAMPLE):
        [entry] = re.findall(r"```python\n(.*?)```", STEPS, re.DOTALL)
        table = eval("{" + entry + "}", {"Choice": registry.Choice})
        original = programs.kernel_source
        file = next(iter(table.values())).header
        monkeypatch.setattr(programs, "kernel_source", lambda n: header if n == file else original(n))
        monkeypatch.setattr(registry, "TECHNIQUES", registry.TECHNIQUES | table)
        monkeypatch.setitem(registry.FAMILIES, "technique", registry.TECHNIQUES)
        return next(iter(table))

    return add


def check(device, technique, field):
    """As the tests of all techniques hold one to the exact distribution."""
    length = exit_distance(*RAYS["oblique"])
    probe = Probe(device, scene_with(field), technique=technique, majorant="grid")
    t, weights, *_ = sample_walks(probe, RAYS["oblique"], length, 1 << 16)
    assert_weighted_collisions(
        t, weights[:, 0], exact_depth(field, "oblique")[0], length, largest_z(41), field
    )


def test_the_example_is_right(device, register):
    for field in ("constant", "ramp"):
        check(device, register(), field)


def test_the_example_is_too_noisy_to_tell_in_a_medium_of_loose_bounds(device, register):
    assert "sparse" in FIELDS
    with pytest.raises(TooNoisyError, match="sparse: too noisy to tell right from wrong"):
        check(device, register(), "sparse")
    with pytest.raises(TooNoisyError, match="R and T: too noisy"):
        assert_a_white_slab_loses_nothing(register(), "residual-ratio")


def test_a_mistake_in_it_is_wrong_and_not_noise(device, register):
    assert DOUBLED in EXAMPLE
    with pytest.raises(AssertionError, match="wrong by") as raised:
        check(device, register(EXAMPLE.replace(DOUBLED, DROPPED)), "ramp")
    assert raised.type is AssertionError


def test_analog_walks_that_miss_a_bin_are_wrong_and_not_noisy():
    """A sum of small weights does not hang on a few of them, whatever it is."""
    tau, t = np.linspace(0, 1.5, 1001), np.random.default_rng(1).exponential(1 / 1.5, 1 << 14)
    t = np.where(t < 1, t, -1.0)
    ones = np.ones(len(t))
    assert_weighted_collisions(t, ones, tau, 1.0, largest_z(41), "exact")
    for wrong in (np.where(t > 0.9, 0.1, t), np.full(len(t), -1.0)):
        with pytest.raises(AssertionError, match="wrong by") as raised:
            assert_weighted_collisions(wrong, ones, tau, 1.0, largest_z(41), "")
        assert raised.type is AssertionError


def test_clvol_ray_shows_the_example_s_weights(register):
    scene = scene_of(medium_of(FIELDS["ramp"](), 4.0, 0.5))
    view = clvol.trace_ray(scene, 3, 5, techniques=[register()], transmittances=[], walks=20, seed=5)
    [watched] = view.watched
    nulls = [(w, c) for w in watched.walks for c in w.collisions if c.kind == "null"]
    assert len(nulls) > 10
    for walk, collision in nulls:
        assert collision.t in [t for t, _ in walk.weights], (
            "a null collision changes the weight, and shows it"
        )
    assert max(value[0] for w in watched.walks for _, value in w.weights) > 1.5
