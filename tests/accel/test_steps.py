"""Densities beyond what a walk can do are refused: it would be given up, after minutes."""

from __future__ import annotations

import re

import numpy as np
import pytest
from places import ROOT

import clvol
from clvol.accel.bounds import Bounds
from clvol.accel.sparse_bounds import from_dense
from clvol.accel.steps import MOST_STEPS, worst_cell

RAMP = (np.indices((16, 16, 16)).sum(axis=0) / 45).astype(np.float32)


def test_the_bound_is_that_of_the_device() -> None:
    header = (ROOT / "cl" / "tracking" / "interface.h").read_text(encoding="utf-8")
    steps, legs = (re.search(rf"{name} \(1u << (\d+)\)", header)[1] for name in ("WALK_STEPS", "WALK_LEGS"))
    assert 2 ** (int(steps) + int(legs)) == MOST_STEPS


@pytest.mark.parametrize("made", [lambda bounds: bounds, from_dense], ids=["dense", "sparse"])
def test_steps_are_the_depth_of_a_cell_or_end_with_a_collision(made) -> None:
    """An empty corner: the depth along a diagonal; a density of at least 1/4: four tentative collisions."""
    low, high = np.full((2, 1, 1, 1), 0.25, np.float32), np.ones((2, 1, 1, 1), np.float32)
    extent = np.array([1.0, 2.0, 2.0])
    assert worst_cell(made(Bounds(low, high, 4)), extent, 1e6) == pytest.approx(4)
    low[1] = 0
    assert worst_cell(made(Bounds(low, high, 4)), extent, 1e6) == pytest.approx(3e6)
    assert worst_cell(made(Bounds(low, 0 * high, 4)), extent, 1e6) == 0


def scene(scale: float) -> clvol.Scene:
    return clvol.volume_scene(RAMP, density_scale=scale, size=(4, 4), spp=1, albedo=0)


def test_what_walks_cannot_do_is_refused_and_exact_flights_do_it() -> None:
    with pytest.raises(clvol.SceneError, match=r"given up after .* looks as solid.* technique="):
        clvol.render(scene(1e12))
    picture = clvol.render(scene(1e12), technique="regular", transmittance="regular")
    assert picture.stats["walks_exhausted"] == 0
    opacity = [(0.3, 0), (0.5, 1e30)]
    with pytest.raises(clvol.SceneError, match=r"lower the scale or the opacity$"):
        clvol.show(RAMP, transfer={"opacity": opacity}, size=(4, 4), spp=1)


def test_bounds_multiplied_beyond_that_are_refused_and_their_scale_is_to_blame(caplog) -> None:
    for choices in ({}, {"majorant": "kdtree", "technique": "spectral"}):
        with pytest.raises(
            clvol.OptionError, match=r"majorant_scale=1e\+30 makes .* given up after .* quick"
        ):
            clvol.render(scene(10), majorant_scale=1e30, **choices)
    clvol.plan(scene(10), majorant_scale=1e30, technique="regular", transmittance="regular")
    clvol.render(scene(10), majorant_scale=1e3)
    assert not caplog.records
    clvol.render(scene(10), majorant_scale=3e6, technique="delta")
    assert "majorant_scale=3000000.0 makes" in str(caplog.records[0].message)


def test_what_takes_long_is_said_and_rendered(caplog: pytest.LogCaptureFixture) -> None:
    clvol.render(scene(1e7), technique="delta")
    assert "tentative collisions; " in caplog.text
    caplog.clear()
    clvol.render(scene(1e5), technique="delta")
    assert not caplog.records
