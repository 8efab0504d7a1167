"""Pictures by every unbiased technique against answers nobody here rendered: furnaces, published slabs and
half-spaces, closed forms of emission.

The transmittances take turns, so that each goes with some technique here.  Unless a test says otherwise its
false-alarm rate is 1e-4, at fixed seeds.
"""

import itertools

import numpy as np
import pytest
from pictures import assert_matches, box, homogeneous, mean_and_error, picture, volume
from slabs import HALF_SPACES, SLABS, assert_a_white_slab_loses_nothing, graded_slab
from stat_tests import largest_z, require_precision, z_score
from walks import unbiased

from clvol import render
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter, Medium

TECHNIQUES = unbiased("technique")
PAIRS = list(zip(TECHNIQUES, itertools.cycle(unbiased("transmittance")), strict=False))
CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
DARK_SUN = DirectionalEmitter((0.0,), (0.0, -1.0, 0.0))
"""Asks for shadow rays under a uniform sky."""


def lumps(channels=()):
    return np.random.default_rng(3).uniform(0.0, 1.0, (6, 5, 4, *channels)) ** 2


def emitting(sigma_t, albedo, scale, **emission):
    """A heterogeneous medium that emits."""
    return Medium(sigma_t, ConstVolume(albedo), scale, homogeneous=False, **emission)


def seen(medium, lights, eye=(0.5, 0.8, -4.0), **integrator):
    return picture([box(*CUBE, medium)], lights, eye, (0, 0, 0.2), 24.0, (4, 4), **integrator)


# -- furnaces --------------------------------------------------------------------------------------

ABSORPTIONS = itertools.cycle(("sample", "weight", "mixed"))
FURNACES = [(*pair, absorption) for pair, absorption in zip(PAIRS, ABSORPTIONS, strict=False)]


@pytest.mark.parametrize("channels, scale", [((), 4.0), ((3,), 3.0)], ids=["grey", "coloured"])
@pytest.mark.parametrize("technique, transmittance, absorption", FURNACES)
def test_nothing_shows_in_a_furnace(technique, transmittance, absorption, channels, scale):
    """Albedo 1 in uniform radiance, and Kirchhoff: what absorbs and emits L_e in an environment of L_e."""
    choices = {"technique": technique, "transmittance": transmittance, "absorption": absorption}
    sky = (2.0, 1.998, 2.0)
    for albedo in (1.0, 0.7):
        medium = emitting(volume(lumps(channels), *CUBE), (albedo,), (scale,), emission=ConstVolume(sky))
        scene = seen(medium, (ConstantEmitter(sky), DARK_SUN), eye=(0.3, -0.4, 0.2))
        result = render(scene, spp=1 << 14, seed=3, **choices)
        assert result.metadata["technique"] == technique
        assert result.metadata["transmittance"] == transmittance
        assert_matches(result, sky, bias=0.025)


# -- emission --------------------------------------------------------------------------------------


def narrow(medium, **keywords):
    """Nearly parallel rays, straight on; the lights are out, so that kernels are shared with furnaces."""
    shapes = [box(*CUBE, medium)]
    return picture(
        shapes,
        (ConstantEmitter((0.0, 0.0, 1e-9)), DARK_SUN),
        (0.1, 0.2, -900.0),
        (0.1, 0.2, 0.0),
        1e-3,
        (2, 2),
        **keywords,
    )


@pytest.mark.parametrize("sigma, radiance", [(1.3, 2.0), ((2.0, 1.0, 0.2), (1.0, 2.0, 3.0))])
def test_a_homogeneous_absorbing_emitter_is_its_closed_form(sigma, radiance):
    """L_e (1 - exp(-sigma L)), from homogeneous media, which need no technique."""
    medium = homogeneous(sigma, 0.0)
    radiance = tuple(np.atleast_1d(radiance).astype(float))
    medium = Medium(medium.sigma_t, medium.albedo, emission=ConstVolume(radiance))
    answer = np.array(radiance) * -np.expm1(-2.0 * np.atleast_1d(sigma))
    assert_matches(render(narrow(medium), spp=1 << 18, seed=4), answer, bias=0.006)


@pytest.mark.parametrize("colours", [(1.0,), (2.0, 1.0, 0.4)], ids=["grey", "coloured"])
@pytest.mark.parametrize("technique, transmittance, absorption", FURNACES)
def test_an_absorbing_emitting_ramp_is_its_closed_form(technique, transmittance, absorption, colours):
    """A density that grows linearly along the view: tau = (s0 + s1) L / 2, clamped ends added."""
    profile = np.linspace(0.1, 1.0, 33)
    shares = np.array(colours) * (np.linspace(0.999, 1, 33)[:, None] if len(colours) > 1 else 1)
    values = profile[:, None] * shares.reshape(-1, len(colours))  # not proportional: three channels
    edge = 2.0 / 33
    tau = edge * (values[:-1] + values[1:]).sum(axis=0) / 2 + edge / 2 * (values[0] + values[-1])
    grid = np.broadcast_to(values[:, None, None], (33, 3, 4, len(colours)))
    emission = {"emission": ConstVolume((1.7, 1.7, 1.6))}
    medium = emitting(volume(grid if len(colours) > 1 else grid[..., 0], *CUBE), (0.0,), (1.5,), **emission)
    choices = {"technique": technique, "transmittance": transmittance, "absorption": absorption}
    result = render(narrow(medium), spp=1 << 17, seed=5, **choices)
    assert_matches(result, np.array([1.7, 1.7, 1.6]) * -np.expm1(-1.5 * tau), bias=0.02)


def test_emission_scales_with_its_volume_and_not_with_what_scatters():
    """Emission is sigma_a L_e: half the albedo's rest, and L_e from a grid of three channels."""
    glow = volume(np.broadcast_to([1.0, 0.5, 0.25], (3, 3, 3, 3)).copy(), *CUBE)
    medium = emitting(volume(np.ones((3, 3, 3)), *CUBE), (0.5,), (1.0,), emission=glow, emission_scale=2.0)
    result = render(narrow(medium, max_depth=1), spp=1 << 17, seed=6)
    assert_matches(result, 0.5 * 2.0 * np.array([1.0, 0.5, 0.25]) * -np.expm1(-2.0))


def test_a_temperature_grid_glows_in_its_blackbody_colour():
    from clvol.tables.blackbody import blackbody_rgb

    field = np.full((3, 3, 3), 1.5)
    keywords = {"temperature": volume(field, *CUBE), "temperature_offset": -0.5, "temperature_scale": 1200.0}
    medium = emitting(volume(np.ones((3, 3, 3)), *CUBE), (0.0,), (1.0,), emission_scale=3.0, **keywords)
    answer = 3.0 * blackbody_rgb(np.array([2400.0]))[0] * -np.expm1(-2.0)
    assert_matches(render(narrow(medium), spp=1 << 17, seed=7), answer)


def test_emission_at_the_winning_collision_serves_overlapping_media():
    """Two halves of the same stuff, one upon the other, glow as the whole."""
    grid = volume(np.ones((3, 3, 3)), *CUBE)
    half = emitting(grid, (0.3,), (0.5,), emission=ConstVolume((1.0, 2.0, 3.0)))
    shapes = [box(*CUBE, half), box(*CUBE, half)]
    scene = picture(shapes, (), (0.1, 0.2, -900.0), (0.1, 0.2, 0.0), 1e-3, (2, 2), max_depth=1)
    result = render(scene, spp=1 << 18, seed=8)
    assert_matches(result, 0.7 * np.array([1.0, 2.0, 3.0]) * -np.expm1(-2.0))


def test_max_depth_zero_shows_no_emission():
    medium = emitting(volume(np.ones((3, 3, 3)), *CUBE), (0.0,), (1.0,), emission=ConstVolume((1.0,)))
    assert (render(narrow(medium, max_depth=0), spp=16).image == 0).all()


# -- published slabs and half-spaces -----------------------------------------------------------------


@pytest.mark.parametrize("technique, transmittance", PAIRS)
def test_slabs_reflect_and_transmit_what_is_published(technique, transmittance):
    bound = largest_z(2 * len(SLABS))
    for albedo, g, thickness, reflected, transmitted in SLABS:
        scene = graded_slab(albedo, g, thickness, (1, 0, 0), (0, 1, 0))
        result = render(scene, spp=1 << 16, seed=9, technique=technique, transmittance=transmittance)
        (r, t, _), error = mean_and_error(result)
        require_precision(error[:2], 0.0011, "R and T")
        assert abs(z_score(r, error[0] ** 2, reflected)) < bound, f"R = {r:.5f} ± {error[0]:.5f}"
        assert abs(z_score(t, error[1] ** 2, transmitted)) < bound, f"T = {t:.5f} ± {error[1]:.5f}"


@pytest.mark.parametrize("technique, transmittance", PAIRS)
def test_half_spaces_of_three_colours_reflect_what_chandrasekhar_says(technique, transmittance):
    """Extinction 6 : 3 : 1 does not show in a half-space; each channel is thick enough for its albedo."""
    for albedo, spp in ((0.99, 0.9, 0.5), 1 << 14), ((0.8, 0.8, 0.5), 1 << 13):
        scene = graded_slab(albedo, 0.0, 25.0, (1, 1, 1), (0, 0, 0), (6.0, 3.0, 1.0), edge=500.0)
        result = render(scene, spp=spp, seed=10, technique=technique, transmittance=transmittance)
        assert result.stats["paths_cut_by_max_depth"] == result.stats["non_finite"] == 0
        mean, error = mean_and_error(result)
        expected = np.array([HALF_SPACES[a] for a in albedo])
        require_precision(error, 0.045 * expected, "R")
        z = np.abs(z_score(mean, error**2, expected))
        assert z.max() < largest_z(6), f"{mean} ± {error}, not {expected}"


@pytest.mark.parametrize("technique, transmittance", PAIRS)
def test_a_white_slab_loses_nothing(technique, transmittance):
    assert_a_white_slab_loses_nothing(technique, transmittance)
