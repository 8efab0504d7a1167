"""Light added by sums along walks instead of by whether these collide shows the same picture.

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
from clvol import render
from clvol.rendering import light_cache
from clvol.scene.records import ConstantEmitter, DirectionalEmitter, Phase
from clvol.tables import media

CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
SKY, SUN = ConstantEmitter((0.3,)), DirectionalEmitter((4.0,), (0.6, -0.8, 0.0))
LUMPS = np.random.default_rng(6).random((9, 8, 7), dtype=np.float32) ** 3
WAYS = [
    {"lanes": "16", "majorant": "grid"},
    {"lanes": "off", "majorant": "grid"},
    {"lanes": "4", "majorant": "global", "lookup": "stochastic"},
]


def scene(lights=(SKY, SUN), albedo=0.9, scale=2.0, **integrator):
    medium = gridded(volume(LUMPS, *CUBE), albedo, scale=scale)
    eye, towards = (0.4, 0.5, -4.0), (0.0, 0.0, 0.0)
    return picture([box(*CUBE, medium)], lights, eye, towards, 30.0, (8, 8), **integrator)


@functools.cache
def shown(background, spp=1 << 11, limits=(), **options):
    seed = seed_of("background", background, *limits, *options.values())
    options = {"technique": "delta", "background": background} | options
    return render(scene(**dict(limits)), spp=spp, seed=seed, **options)


@pytest.mark.contract
@pytest.mark.parametrize("way", WAYS, ids=lambda way: "-".join(way.values()))
def test_the_picture_is_the_same(way):
    expected, sampled = shown("expected", **way), shown("sampled", **WAYS[0])
    assert expected.metadata["background"] == "expected"
    assert_same_picture(expected, sampled)


@pytest.mark.contract
@pytest.mark.parametrize("way", WAYS[:2], ids=lambda way: "-".join(way.values()))
def test_it_is_less_noisy_where_the_transmittance_is_well_known(way):
    """Loose majorants make for many look-ups."""
    limits = (("lights", (DirectionalEmitter((12.0,), (0.6, -0.8, 0.0)),)), ("scale", 0.7))
    options = {"spp": 256, "limits": limits, "majorant_scale": 4.0} | way
    noise = {name: shown(name, **options).noise for name in ("expected", "sampled")}
    assert noise["expected"] < 0.8 * noise["sampled"]


@pytest.mark.contract
@pytest.mark.parametrize("wrong", [0.0, 4.0, -3.0], ids=["zero", "too bright", "negative"])
@pytest.mark.parametrize("way", WAYS[:2], ids=lambda way: "-".join(way.values()))
def test_any_guess_of_what_collisions_bring_has_the_same_mean(monkeypatch, way, wrong):
    for guess in ("expected_albedo", "escaping_share"):
        monkeypatch.setattr(media, guess, lambda *_: np.full(3, wrong))
    options = {"technique": "delta", "background": "expected"} | way
    result = render(scene(), spp=1 << 11, seed=seed_of("guess", wrong, *way.values()), **options)
    assert_same_picture(result, shown("sampled", **WAYS[0]))


@pytest.mark.contract
@pytest.mark.parametrize("way", WAYS[:2], ids=lambda way: "-".join(way.values()))
def test_what_is_seen_through_a_medium_that_nothing_scatters_twice_in_is_its_transmittance(way):
    """max_depth 1 leaves only what gets through: the sky's radiance times exp(-depth)."""
    medium = gridded(volume(np.ones((4, 4, 4), np.float32), *CUBE), 0.5, scale=0.7)
    eye, towards = (0.0, 0.0, -900.0), (0.0, 0.0, 0.0)
    seen = picture([box(*CUBE, medium)], [SKY, SUN], eye, towards, 1e-3, (4, 4), max_depth=1)
    options = {"technique": "delta", "background": "expected"} | way
    result = render(seen, spp=1 << 15, seed=5, **options)
    assert_matches(result, 0.3 * np.exp(-1.4), bias=0.015)


@pytest.mark.parametrize("way", WAYS[:2], ids=lambda way: "-".join(way.values()))
def test_a_furnace_has_no_noise(way):
    """Where collisions bring what is behind, nothing is left to chance."""
    furnace = scene([ConstantEmitter((1.0,))], albedo=1.0)
    result = render(furnace, spp=16, seed=2, technique="delta", background="expected", **way)
    assert result.image == pytest.approx(1.0, rel=1e-4)


@pytest.mark.contract
@pytest.mark.parametrize("way", WAYS[:2], ids=lambda way: "-".join(way.values()))
def test_walks_of_several_legs_neither_lose_nor_double_it(bounds, way):
    bounds(WALK_STEPS=1)
    options = {"technique": "delta", "background": "expected"} | way
    result = render(scene(scale=5.0), spp=1 << 11, seed=8, **options)
    assert_same_picture(result, shown("sampled", limits=(("scale", 5.0),), **WAYS[0]))


@quick_first("limits", [{"max_depth": 2}, {"hide_emitters": True}], ids=["depth", "hidden"])
def test_limits_of_depth_and_hidden_emitters_hold(limits):
    one, other = (shown(name, limits=tuple(limits.items()), **WAYS[0]) for name in ("expected", "sampled"))
    assert_same_picture(one, other)


PEAK = {
    "lights": (DirectionalEmitter((4.0,), (0.6, -0.8, 0.0)), DirectionalEmitter((1.0,), (0.0, -0.8, 0.6)))
}


@functools.cache
def peaked(background, spp=1 << 12, **options):
    described = scene(albedo=0.95, scale=1.5, **PEAK)
    [shape] = described.shapes
    shape = replace(shape, interior=replace(shape.interior, phase=Phase("hg", 0.7)))
    seed = seed_of("peaked", background, *options.values())
    options = {"technique": "delta", "background": background} | options
    return render(replace(described, shapes=(shape,)), spp=spp, seed=seed, **options)


@pytest.mark.contract
@pytest.mark.parametrize("way", WAYS, ids=lambda way: "-".join(way.values()))
@pytest.mark.parametrize("cache", ["on", "off"])
def test_suns_and_peaks_of_phase_functions_are_the_same(way, cache):
    assert_same_picture(peaked("expected", shadow_cache=cache, **way), peaked("sampled", **WAYS[0]))


@pytest.mark.contract
@pytest.mark.parametrize("wrong", ["zero", "random", "negative"])
@pytest.mark.parametrize("way", WAYS[:2], ids=lambda way: "-".join(way.values()))
def test_any_cache_of_lights_has_the_same_mean(monkeypatch, way, wrong):
    """Rows that the device is told, not those that were filled."""
    fill = light_cache.run_kernel

    def spoilt(device, kernel, count, arguments, inputs, outputs, *rest, **more):
        fill(device, kernel, count, arguments, inputs, outputs, *rest, **more)
        if len(outputs) == 2:
            numbers = np.random.default_rng(1).uniform(0.0, 1.0, outputs[0].shape)
            outputs[0][:] = {"zero": 0.0, "random": numbers, "negative": -2.0}[wrong]

    monkeypatch.setattr(light_cache, "run_kernel", spoilt)
    options = {"technique": "delta", "background": "expected"} | way
    result = render(scene(), spp=1 << 12, seed=seed_of("cache", wrong, *way.values()), **options)
    assert_same_picture(result, shown("sampled", **WAYS[0]))


def test_it_is_less_noisy_in_thin_media_under_a_sun():
    """Half the variance at least; much more is less of whatever is seen."""
    thin = {"limits": (("scale", 0.3), ("lights", (SUN,))), "spp": 64, "lanes": "16", "majorant": "grid"}
    noise = {name: shown(name, **thin).noise for name in ("expected", "sampled")}
    assert noise["expected"] < 0.7 * noise["sampled"]


WHITE = {
    "constant": 0.99,
    "volume": volume(np.random.default_rng(2).uniform(0.8, 1.0, (5, 5, 5)), *CUBE),
    "where the medium is": volume(np.where(LUMPS > 0.1, 0.9, 0.2), *CUBE),
}


@pytest.mark.parametrize("scale", [0.2, 4.0])
@pytest.mark.parametrize("albedo", WHITE)
def test_it_is_less_noisy_where_scattered_light_is_nearly_what_is_behind(albedo, scale):
    """A path that collides brings nearly the sky that it hides: chance makes little noise there, too."""
    white = (("scale", scale), ("lights", (SKY,)), ("albedo", WHITE[albedo]))
    options = {"spp": 256, "limits": white, "sampler": "independent", "lanes": "16", "majorant": "grid"}
    noise = {name: shown(name, **options).noise for name in ("expected", "sampled")}
    assert noise["expected"] < 0.8 * noise["sampled"]


@functools.cache
def thrice_lit(background):
    """A peaked phase function, far from whose peaks all suns are."""
    directions = (0.6, -0.8, 0.0), (-0.6, -0.8, 0.0), (0.0, -0.8, 0.6)
    suns = tuple(DirectionalEmitter((4.0 - n,), way) for n, way in enumerate(directions))
    described = scene(suns, albedo=0.99, scale=0.2)
    [shape] = described.shapes
    shape = replace(shape, interior=replace(shape.interior, phase=Phase("hg", 0.9)))
    options = {"technique": "delta", "sampler": "independent", "lanes": "16", "background": background}
    return render(replace(described, shapes=(shape,)), spp=1 << 12, seed=seed_of(background), **options)


def test_it_is_less_noisy_where_the_peaks_of_suns_are_elsewhere():
    """What the other suns bring is not what an isotropic phase function would make of them."""
    assert thrice_lit("expected").noise < thrice_lit("sampled").noise
    assert_same_picture(thrice_lit("expected"), thrice_lit("sampled"))


def test_what_escapes_of_the_light_in_a_medium_is_known_at_its_limits():
    depth = np.array([0.0, 1.0, np.inf])
    assert media.escaping_share(np.ones(3), depth) == pytest.approx(1.0)
    assert media.escaping_share(np.zeros(3), depth) == pytest.approx(0.0)
    assert media.escaping_share(np.full(3, 0.5), depth) == pytest.approx([0.5, 1 / 3, 0.0], abs=1e-8)


def test_it_is_taken_wherever_walks_can():
    found = [
        render(s, spp=1, technique="delta").metadata["background"]
        for s in (scene(scale=1.0), scene(scale=50.0), scene([SKY], scale=1.0))
    ]
    assert found == ["expected"] * 3
    assert clvol.plan(scene(), technique="regular").in_force["background"] == "none"
