"""Media so dense that rounding hides places in a mean free path: how far off, and that it is told."""

import logging

import numpy as np
import pytest
from tiers import quick_first

import clvol
from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.thickness import AHEAD, EYE
from clvol.tables.prepare import prepare
from clvol.tables.resolution import scattering_error

SPECK = {"type": "sphere", "center": (1000.0, 300.0, 900.0), "radius": 0.5, "bsdf": {"type": "diffuse"}}
"""Far away, so that the cube is 500 from the scene's centre."""


def scene(sigma_t, *, far=False, albedo=1.0):
    cube = Block(np.array(1.0), (sigma_t,), np.eye(4))
    return scenes.sunlit([cube], EYE, AHEAD, albedo=albedo) | ({"speck": SPECK} if far else {})


def words(described, caplog):
    with caplog.at_level(logging.WARNING, "clvol"):
        prepare(clvol.load_dict(described))
    return [record.getMessage() for record in caplog.records if "mean free path" in record.getMessage()]


@quick_first(("sigma_t", "far"), [(1e7, False), (1e6, False), (1e4, True)])
def test_scattered_light_is_off_as_predicted(sigma_t, far):
    """At an error of 1e-4 and of 1 %; that predicted is an estimate, from above."""
    result = clvol.render(clvol.load_dict(scene(sigma_t, far=far)), spp=4096, sampler="joint", seed=1)
    off = result.image.mean(dtype=float) / scenes.slab_light(sigma_t)[0] - 1
    predicted = scattering_error(sigma_t, 500.0 if far else 0.5)
    assert 0.6 * predicted < off < 1.1 * predicted


def test_what_is_off_is_told(caplog):
    (said,) = words(scene(1e7), caplog)
    assert "1e-07 where it is densest" in said and "6e-08 apart" in said and "1.5 %" in said
    assert "at 0.26 of its density" in said


@pytest.mark.parametrize(("more", "told"), [({}, True), ({"albedo": 0.0}, False)])
def test_far_from_the_centre_places_are_coarser(caplog, more, told):
    """And what scatters nothing needs none."""
    assert bool(words(scene(1e4, far=True, **more), caplog)) == told


def test_what_is_right_is_not_told(caplog):
    assert not words(scene(1e6), caplog)
    assert not words(scene(1e3, far=True), caplog)


def test_the_densest_voxel_counts(caplog):
    values = np.zeros((4, 4, 4))
    values[1, 2, 3] = 1.0
    spike = Block(values, (1e7,), np.eye(4))
    assert words(scenes.sunlit([spike], EYE, AHEAD), caplog)
