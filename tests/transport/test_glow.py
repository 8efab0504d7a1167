"""A medium's emission_density shows whatever its extinction: the integral of T q along every ray.

False alarms: 1e-4 for each comparison, at fixed seeds.  Every technique proves to be right to two percent,
and all together to half a percent.
"""

import functools

import numpy as np
import pytest
from pictures import assert_matches, assert_mean, assert_pooled, ball, box, hg, picture, volume
from stat_tests import seed_of
from tiers import quick_first
from walks import unbiased

import clvol
from clvol import render
from clvol.device import programs
from clvol.planning import registry
from clvol.scene.records import (
    ConstantEmitter,
    ConstVolume,
    Film,
    Integrator,
    Medium,
    Orthographic,
    ReconstructionFilter,
    Scene,
)

TECHNIQUES = unbiased("technique")
CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
PROFILE, GLOW = np.linspace(0.1, 1.0, 9), np.array([3.0, 0.5, 0.1, 1.0, 2.0])
GREY, COLOURED = (2.5,), (2.5, 1.0, 4.0)
CASES = [(t, c) for c in (GREY, COLOURED) for t in TECHNIQUES]
QUICK = [("delta", GREY), ("spectral", COLOURED), ("regular", COLOURED)]


def const(*value):
    return ConstVolume(tuple(map(float, value)))


def layers(profile, lower=-1.0, upper=1.0, filter_type="trilinear"):
    """A field that changes along z alone."""
    values = np.broadcast_to(np.asarray(profile)[:, None, None], (len(profile), 3, 4))
    return volume(values, (-1.0, -1.0, lower), (1.0, 1.0, upper), filter_type)


def seen(*shapes, emitters=(), x=0.1, **integrator):
    """Nearly parallel rays along z, at one x."""
    return picture(shapes, emitters, (x, 0.2, -90.0), (x, 0.2, 0.0), 1e-3, (2, 2), **integrator)


def along(profile, lower=-1.0, upper=1.0, steps=40_000):
    """Its value at even points z in -1..1 of the ray, 0 outside of its span."""
    z = (np.arange(steps) + 0.5) * (2 / steps) - 1
    place = (z - lower) / (upper - lower)
    inside = (place > 0) & (place < 1)
    return np.where(inside, np.interp(place * len(profile) - 0.5, np.arange(len(profile)), profile), 0.0)


def gathered(sigma, glow):
    """The integral of T q over z in -1..1, by the values at even points; float64 (channels,)."""
    step = 2.0 / np.shape(sigma)[-1]
    depth = (np.cumsum(sigma, axis=-1) - 0.5 * sigma) * step
    return (np.exp(-depth) * glow).sum(axis=-1) * step


# -- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "colours",
    [pytest.param((1.0,), marks=pytest.mark.contract), (1.0, 0.5, 2.0)],
    ids=["grey", "coloured"],
)
def test_a_homogeneous_glow_is_seen_at_any_depth(colours):
    for depth in (0.0, 1e-6, 1.0, 10.0):
        sigma = depth / 2 * np.array(colours)
        colour = 1.0, 2.0, 0.5
        medium = Medium(const(*sigma), const(0), emission_density=const(3), emission_density_scale=colour)
        with np.errstate(invalid="ignore"):
            way = np.where(sigma > 0, -np.expm1(-2 * sigma) / sigma, 2.0)
        result = render(seen(box(*CUBE, medium)), spp=1 << 14, seed=3)
        expected = 3 * np.array(colour) * way
        if depth < 1e-3:  # hardly a walk collides
            assert result.image == pytest.approx(np.broadcast_to(expected, (2, 2, 3)), rel=2e-6)
        else:
            assert_matches(result, expected, bias=0.05)


def test_what_is_uniform_in_vacuum_has_no_noise_and_raises_no_doubt(caplog):
    medium = Medium(const(0), const(0), emission_density=const(1.5))
    result = render(seen(box(*CUBE, medium)), spp=16, seed=4)
    assert result.image == pytest.approx(3.0, rel=1e-6)
    assert not result.variance.any()
    assert "met" not in caplog.text


def ball_scene(medium):
    """The whole of a unit sphere under parallel rays."""
    sensor = Orthographic(clvol.look_at((0.0, 0.0, -4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    film = Film(2, 2, ReconstructionFilter("box", 0.5))
    return Scene(sensor, film, Integrator(max_depth=1_000_000), (ball((0, 0, 0), 1.0, medium),), (), spp=16)


@pytest.mark.parametrize("scale", [0.0, 1e-6, 1.0, 5.0])
def test_however_light_scatters_its_mean_way_through_a_ball_is_that_of_straight_lines(scale):
    """4 V / S, of rays that come evenly from all round, where nothing absorbs (Blanco and Fournier 2003)."""
    medium = Medium(const(scale), const(1), phase=hg(0.4), emission_density=const(2))
    assert_mean(render(ball_scene(medium), spp=1 << 16, seed=5), 2 * (4 / 3) * np.pi / 4, bias=0.03)


@functools.cache
def ball_of_grid(technique):
    density = volume(np.ones((4, 5, 6)), *CUBE)
    medium = Medium(density, const(1), (3.0,), hg(0.4), homogeneous=False, emission_density=const(2))
    return render(ball_scene(medium), spp=1 << 17, seed=seed_of(technique), technique=technique)


@pytest.mark.contract
@pytest.mark.parametrize("technique", TECHNIQUES)
def test_no_technique_changes_that_mean_way(technique):
    assert_mean(ball_of_grid(technique), 2 * (4 / 3) * np.pi / 4, bias=0.02)


@pytest.mark.contract
def test_half_a_percent_of_that_mean_way_would_show():
    assert_pooled([(ball_of_grid(t), 2 * (4 / 3) * np.pi / 4) for t in TECHNIQUES])


# -- quadrature ------------------------------------------------------------------------------------


@functools.cache
def layered(technique, scale, **options):
    medium = Medium(layers(PROFILE), const(0), scale, homogeneous=False, emission_density=layers(GLOW))
    options = {"spp": 1 << 15, "seed": seed_of("glow", technique, scale, *options.items())} | options
    return render(seen(box(*CUBE, medium)), technique=technique, **options)


def answer(scale):
    return gathered(np.array(scale)[:, None] * along(PROFILE), along(GLOW))


@quick_first(("technique", "scale"), QUICK)
def test_the_glow_of_layers_is_that_of_quadrature(technique, scale):
    assert_matches(layered(technique, scale), answer(scale), bias=0.02)


@pytest.mark.contract
@pytest.mark.parametrize("majorant", ["global", "grid", "kdtree"])
@pytest.mark.parametrize(("technique", "scale"), CASES)
def test_every_technique_gathers_it_under_every_majorant(technique, scale, majorant):
    assert_matches(layered(technique, scale, majorant=majorant), answer(scale), bias=0.02)


@pytest.mark.contract
@pytest.mark.parametrize("scale", [GREY, COLOURED])
def test_half_a_percent_would_show_in_the_layers_of_all_techniques(scale):
    assert_pooled([(layered(t, scale, majorant="grid"), answer(scale)) for t in TECHNIQUES])


@pytest.mark.contract
@pytest.mark.parametrize("lanes", ["8", "off"])
def test_it_is_gathered_behind_walks_in_lanes(lanes):
    result = layered("delta", GREY, lanes=lanes, majorant="grid")
    assert result.metadata["lanes"] == lanes
    assert_matches(result, answer(GREY), bias=0.02)


@quick_first(
    ("technique", "scale", "lanes"),
    [("delta", GREY, "8"), ("spectral", COLOURED, "auto"), ("regular", COLOURED, "auto")],
)
def test_legs_neither_lose_nor_double_it(bounds, technique, scale, lanes):
    bounds(WALK_STEPS=2)
    options = {"lanes": lanes, "majorant": "grid", "seed": 9}
    assert_matches(layered(technique, scale, **options), answer(scale), bias=0.02)


# -- what absorbs as it emits does not show --------------------------------------------------------


@functools.cache
def in_its_own_radiance(technique, scale, albedo=0.6):
    """Of a medium that emits sigma_a L per length under a sky of L nothing is seen (Kirchhoff)."""
    absorbed = tuple((1 - albedo) * s for s in scale)
    density = np.random.default_rng(4).random((6, 5, 7), dtype=np.float32) ** 2
    field = volume(density, *CUBE)
    medium = Medium(
        *(field, const(albedo), scale, hg(0.3)),
        homogeneous=False,
        emission_density=field,
        emission_density_scale=absorbed,
    )
    scene = seen(box(*CUBE, medium), emitters=[ConstantEmitter((1.0,))], max_depth=1_000_000)
    return render(scene, spp=1 << 15, seed=seed_of("own", technique, scale), technique=technique)


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "scale"), CASES)
def test_a_medium_in_its_own_radiance_does_not_show(technique, scale):
    assert_matches(in_its_own_radiance(technique, scale), 1.0, bias=0.03)


@pytest.mark.contract
@pytest.mark.parametrize("scale", [GREY, COLOURED])
def test_half_a_percent_of_its_own_radiance_would_show(scale):
    assert_pooled([(in_its_own_radiance(t, scale), 1.0) for t in TECHNIQUES])


def test_a_glow_that_is_a_percent_too_bright_is_noticed():
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(layered("delta", GREY), 1.015 * answer(GREY), bias=0.02)


def test_weights_that_points_lack_are_noticed(monkeypatch):
    """The path's weight at the start of a walk, instead of that at the point."""
    original = programs.kernel_source
    weight = "return collision.beta;"

    def source(name):
        text = original(name)
        if name == "stages/glow.h":
            assert weight in text
            return text.replace(weight, "return before;")
        return text

    monkeypatch.setattr(programs, "kernel_source", source)
    with pytest.raises(AssertionError, match="deviates"):
        assert_matches(layered("spectral", COLOURED, seed=12), answer(COLOURED), bias=0.02)


def test_nothing_of_it_is_compiled_into_other_scenes():
    dark = Medium(layers(PROFILE), const(0), homogeneous=False, emission=const(1), emission_density=const(0))
    plan = clvol.plan(seen(box(*CUBE, dark)), majorant="global")
    assert not plan.features.glow
    for stage in plan.stages:
        source = programs.stage_source(plan, stage)
        assert not any(name in source for name in ("Glow", "glow_", "CLVOL_HAS_GLOW"))


def test_registered_techniques_are_all_tested():
    assert {t for t, _ in CASES} == {n for n, c in registry.TECHNIQUES.items() if c.header and not c.biased}
