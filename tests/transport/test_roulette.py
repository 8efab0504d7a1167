"""Roulette: pictures keep their radiance, known in closed form, whichever paths it ends and when it begins.

The false-alarm rate is 1e-4 at fixed seeds, and a bias of 0.5 % would be seen (`assert_matches`).
"""

from dataclasses import replace

import pytest
from pictures import assert_matches, ball, homogeneous
from surface_scenes import found, sampled, surfaced

import clvol
from clvol import render
from clvol.device import programs
from clvol.planning.in_force import warnings
from clvol.scene.materials import Diffuse
from clvol.scene.records import ConstVolume

REFLECTANCE = 0.3


def hohlraum(make, rr_depth):
    """A hollow sphere at one temperature, and a dark medium in it: radiance 1 in every direction.

    Walls emit what they do not reflect, and the medium what it absorbs.
    """
    wall = surfaced(
        ball((0, 0, 0), 2.0), Diffuse((REFLECTANCE,)), emission=(1 - REFLECTANCE,), flip_normals=True
    )
    smoke = replace(homogeneous(0.7, 0.4), emission=ConstVolume((1.0,)))
    views = {"eye": (0.1, 0.2, -1.3), "target": (0, 0, 1), "fov": 60.0, "size": (8, 8)}
    return make([wall, ball((0, 0, 0), 1.0, smoke)], lights=(), rr_depth=rr_depth, **views)


def pictured(make, rr_depth, roulette, spp=1 << 11):
    choices = {"transmittance": "none"} if make is found else {"transmittance": "ratio"}
    scene = hohlraum(make, rr_depth)
    return render(scene, spp=spp, seed=3, absorption="weight", roulette=roulette, **choices)


@pytest.mark.contract
@pytest.mark.parametrize("make", [found, sampled])
@pytest.mark.parametrize(("roulette", "rr_depth"), [("depth", 1), ("weight", 1), ("weight", 8)])
def test_roulette_keeps_the_radiance_of_a_hohlraum(make, rr_depth, roulette):
    assert_matches(pictured(make, rr_depth, roulette), 1.0)


@pytest.mark.contract
def test_survivors_that_do_not_stand_for_the_others_are_caught(monkeypatch):
    original = programs.kernel_source

    def source(name):
        text = original(name)
        if name == "stages/bounce.h":
            assert "*beta /= survival;" in text
            text = text.replace("*beta /= survival;", "*beta /= sqrt(survival);")
        return text

    monkeypatch.setattr(programs, "kernel_source", source)
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(pictured(found, 8, "weight"), 1.0)


def test_weight_ends_paths_that_depth_would_follow():
    """No path leaves the sphere: below rr_depth weight ends what depth follows."""
    followed, ended = (
        pictured(found, 8, roulette, spp=128).stats["real_collisions"] for roulette in ("depth", "weight")
    )
    assert ended < 0.6 * followed


def test_roulette_by_weight_is_for_surfaces_that_scatter():
    room = hohlraum(found, 8)
    smoke = replace(room, shapes=(room.shapes[1],))
    assert clvol.plan(room).in_force["roulette"] == "weight"
    asked = clvol.plan(smoke, roulette="weight")
    assert clvol.plan(smoke).in_force["roulette"] == asked.in_force["roulette"] == "depth"
    assert next(warnings(asked, {"roulette": "weight"})).startswith(
        "roulette weight is not used: it is for surf"
    )
