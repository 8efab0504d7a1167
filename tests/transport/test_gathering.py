"""Emission gathered at strata of exact flights is what the collisions alone would gather, with less noise.

False alarms: 1e-4 for each comparison, at fixed seeds.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest
from pictures import assert_matches, box, gridded, picture, volume
from stat_tests import assert_same_picture, seed_of
from tiers import quick_first

import clvol
from clvol import layout, render
from clvol.planning import registry
from clvol.scene.records import ConstVolume, Medium

CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
PROFILE, GLOW = np.linspace(0.1, 1.0, 9), np.array([3.0, 0.5, 0.1, 1.0, 2.0])
SCALES = {"grey": (2.5,), "coloured": (2.5, 0.6, 6.0)}
GATHERINGS = tuple(registry.GATHERINGS)


def layers(profile):
    """A density that changes along z alone."""
    return volume(np.broadcast_to(profile[:, None, None], (len(profile), 3, 4)), *CUBE)


def glowing(scale):
    return Medium(layers(PROFILE), ConstVolume((0.0,)), scale, homogeneous=False, emission=layers(GLOW))


def seen(medium):
    """Nearly parallel rays along z."""
    return picture([box(*CUBE, medium)], (), (0.1, 0.2, -900.0), (0.1, 0.2, 0.0), 1e-3, (2, 2))


def along(profile, steps=40_000):
    """Its value at even points of the ray through the cube, and their distance."""
    z = (np.arange(steps) + 0.5) / steps
    return np.interp(z * len(profile) - 0.5, np.arange(len(profile)), profile), 2.0 / steps


def emitted(scale):
    """The integral of sigma_t L_e T along the ray; float64 (channels,)."""
    (density, step), (radiance, _) = along(PROFILE), along(GLOW)
    sigma = np.array(scale)[:, None] * density
    depth = (np.cumsum(sigma, axis=1) - 0.5 * sigma) * step
    return (sigma * radiance * np.exp(-depth)).sum(axis=1) * step


@functools.cache
def layered(gathering, colours):
    seed = seed_of("gathering", gathering, colours)
    options = {"technique": "regular", "gathering": gathering}
    spp = 1 << (15 if colours == "coloured" else 13)
    return render(seen(glowing(SCALES[colours])), spp=spp, seed=seed, **options)


@quick_first("colours", SCALES)
@quick_first("gathering", GATHERINGS)
def test_the_emission_of_layers_is_that_of_quadrature(gathering, colours):
    assert_matches(layered(gathering, colours), emitted(SCALES[colours]), bias=0.03)


@quick_first("colours", SCALES)
def test_strata_have_a_fraction_of_the_noise(colours):
    noise = {name: float(layered(name, colours).noise) for name in GATHERINGS}
    assert noise["strata"] < (0.5 if colours == "grey" else 0.8) * noise["collision"]


@quick_first("steps", [1, 3])
@quick_first("colours", SCALES)
def test_legs_neither_lose_nor_double_emission(bounds, steps, colours):
    """A flight that collided has no next leg; one that did not gathers there what is beyond."""
    bounds(WALK_STEPS=steps)
    options = {"technique": "regular", "gathering": "strata"}
    result = render(seen(glowing(SCALES[colours])), spp=1 << 13, seed=7, **options)
    assert_matches(result, emitted(SCALES[colours]), bias=0.03)


def lumps():
    """A dark medium that glows and scatters."""
    density = np.random.default_rng(4).random((6, 5, 7), dtype=np.float32) ** 2
    medium = gridded(volume(density, *CUBE), 0.5, scale=(4.0,))
    medium = replace(medium, emission=layers(GLOW))
    return picture([box(*CUBE, medium)], (), (0.4, 0.5, -4.0), (0.0, 0.0, 0.0), 30.0, (8, 8))


@functools.cache
def lumpy(**options):
    options = {"technique": "regular"} | options
    return render(lumps(), spp=1 << 11, seed=seed_of("lumpy", *options.values()), **options)


@pytest.mark.contract
@pytest.mark.parametrize(
    "options",
    [
        {"gathering": "collision"},
        {"absorption": "sample"},
        {"absorption": "weight", "sampler": "joint"},
        {"technique": "delta"},
    ],
    ids=lambda options: "-".join(options.values()),
)
def test_strata_show_the_picture_of_every_other_way(options):
    assert lumpy().metadata["gathering"] == "strata"
    assert_same_picture(lumpy(), lumpy(**options))


def test_gathering_is_for_exact_flights_through_what_emits():
    scene = lumps()
    for options, name, strata in (
        ({"technique": "regular"}, "strata", layout.FLIGHT_STRATA),
        ({"technique": "regular", "gathering": "collision"}, "collision", 1),
        ({"technique": "delta"}, "none", 1),
    ):
        planned = clvol.plan(scene, **options)
        assert planned.in_force["gathering"] == name
        assert planned.macros["CLVOL_FLIGHT_STRATA"] == strata
