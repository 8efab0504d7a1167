"""Media so thin that no walk meets an event show their emission all the same, and exactly.

False alarms: 1e-4 for each comparison, at fixed seeds.
"""

import functools

import numpy as np
import pytest
from pictures import assert_matches, assert_pooled, box, picture, volume
from stat_tests import seed_of
from tiers import quick_first, quick_where
from walks import unbiased

from clvol import render
from clvol.planning import registry
from clvol.scene.records import ConstVolume, Medium

TECHNIQUES = unbiased("technique")
CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
PROFILE, GLOW = np.linspace(0.1, 1.0, 9), np.array([3.0, 0.5, 0.1, 1.0, 2.0])
SCALES = {"grey": (1.0,), "coloured": (1.0, 0.3, 0.01)}


def layers(profile):
    """A density that changes along z alone."""
    return volume(np.broadcast_to(profile[:, None, None], (len(profile), 3, 4)), *CUBE)


def seen(medium, x=0.1):
    """Nearly parallel rays along z, at one x."""
    return picture([box(*CUBE, medium)], (), (x, 0.2, -900.0), (x, 0.2, 0.0), 1e-3, (2, 2))


def along(profile, steps=40_000):
    """Its value at even points of the ray through the cube, and their distance."""
    z = (np.arange(steps) + 0.5) / steps
    return np.interp(z * len(profile) - 0.5, np.arange(len(profile)), profile), 2.0 / steps


def emitted(profile, glow, scale):
    """The integral of sigma_t L_e T along the ray, without scattering; float64 (channels,)."""
    (density, step), (radiance, _) = along(profile), along(glow)
    sigma = np.array(scale)[:, None] * density
    depth = (np.cumsum(sigma, axis=1) - 0.5 * sigma) * step
    return (sigma * radiance * np.exp(-depth)).sum(axis=1) * step


CASES = [(t, c) for c in SCALES for t in TECHNIQUES if c == "grey" or registry.TECHNIQUES[t].all_channels]


@functools.cache
def thin_media(technique, colours):
    """Pictures of a very thin and of a thin medium, with what they emit."""
    pictures = []
    for factor in (1e-8, 0.1):
        scale = tuple(factor * s for s in SCALES[colours])
        dark = ConstVolume((0.0,))
        medium = Medium(layers(PROFILE), dark, scale, homogeneous=False, emission=layers(GLOW))
        seed = seed_of("thin emission", technique, colours, factor)
        result = render(seen(medium), spp=1 << 15, seed=seed, technique=technique)
        pictures.append((result, emitted(PROFILE, GLOW, scale)))
    return pictures


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "colours"), CASES)
def test_every_technique_shows_the_emission_of_thin_media(technique, colours):
    for result, answer in thin_media(technique, colours):
        assert_matches(result, answer, bias=0.02)


@pytest.mark.contract
def test_half_a_percent_would_show_in_the_thin_media_of_all_techniques():
    assert_pooled([picture for case in CASES for picture in thin_media(*case)])


@quick_first(("factor", "bound"), [(0.14, 1.0), (0.58, 0.25)])
def test_a_walk_of_several_legs_gathers_no_part_of_a_thin_medium_twice(bounds, factor, bound):
    """Most of the depth in the first leg; also where a bound that does not hold makes it seem thin."""
    bounds(WALK_STEPS=2)
    profile, glow = np.array([1.0, 1.0, *[0.01] * 7]), GLOW[::-1]
    dark = ConstVolume((0.0,))
    medium = Medium(layers(profile), dark, (factor,), homogeneous=False, emission=layers(glow))
    options = {"technique": "regular", "majorant_scale": bound}
    result = render(seen(medium), spp=1 << 16, seed=6, **options)
    assert_matches(result, emitted(profile, glow, (factor,)), bias=0.02)


@quick_where("colours", SCALES, "coloured".__eq__)
def test_homogeneous_media_show_it_at_any_depth(colours):
    for factor in (1e-8, 0.1, 3.0):
        scale = tuple(factor * s for s in SCALES[colours])
        medium = Medium(ConstVolume(scale), ConstVolume((0.0,)), emission=layers(GLOW))
        result = render(seen(medium), spp=1 << 13, seed=3)
        assert_matches(result, emitted(np.ones(2), GLOW, scale), bias=0.04)


def test_a_constant_emitter_that_nothing_attenuates_otherwise_has_no_noise():
    medium = Medium(ConstVolume((1.3,)), ConstVolume((0.0,)), emission=ConstVolume((2.0,)))
    result = render(seen(medium), spp=16, seed=4)
    assert result.image == pytest.approx(-2.0 * np.expm1(-2.6), rel=1e-5)
    assert result.noise < 1e-6


@quick_first("colours", SCALES)
def test_exact_flights_show_a_faint_part_of_a_medium_that_is_thick_elsewhere(colours):
    """No bound of the whole medium says that these rays meet next to nothing."""
    density, factor = np.ones((9, 4, 8)), 1e-8
    density[..., :4] = factor * PROFILE[:, None, None]
    medium = Medium(
        volume(density, *CUBE, "nearest"),
        ConstVolume((0.0,)),
        SCALES[colours],
        homogeneous=False,
        emission=layers(GLOW),
    )
    result = render(seen(medium, x=-0.6), spp=1 << 13, seed=5, technique="regular")
    steps = np.repeat(PROFILE, 400) * factor
    assert_matches(result, emitted(steps, GLOW, SCALES[colours]), bias=0.04)
