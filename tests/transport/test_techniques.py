"""Pictures by every unbiased technique against answers nobody here rendered.

Furnaces, published slabs and half-spaces, closed forms of emission.

The transmittances take turns, so that each goes with some technique here.  Unless a test says otherwise its
false-alarm rate is 1e-4, at fixed seeds.  A picture alone shows a bias of about 1 %; pictures are pooled over
channels' means, albedos and techniques to show one of 0.5 %.
"""

import functools
import itertools

import numpy as np
import pytest
from pictures import assert_matches, assert_pooled, box, homogeneous, mean_and_error, picture, volume
from scipy import stats
from slabs import HALF_SPACES, SLABS, assert_a_white_slab_loses_nothing, graded_slab
from stat_tests import FALSE_ALARM, largest_z, require_precision, seed_of, sidak, z_score
from walks import unbiased

from clvol import render
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter, EnvmapEmitter, Medium

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
COLOURS = {"grey": ((), 4.0), "coloured": ((3,), 3.0)}
SKY = (2.0, 1.998, 2.0)
MAPPED_SKY = EnvmapEmitter(np.tile(np.float32(SKY), (2, 4, 1)), np.eye(4))  # which is sampled, too


@functools.cache
def furnaces(technique, transmittance, absorption, colours):
    """Albedo 1 in uniform radiance, and Kirchhoff: what absorbs and emits L_e in an environment of L_e."""
    channels, scale = COLOURS[colours]
    choices = {"technique": technique, "transmittance": transmittance, "absorption": absorption}
    results = []
    for albedo in (1.0, 0.7):
        medium = emitting(volume(lumps(channels), *CUBE), (albedo,), (scale,), emission=ConstVolume(SKY))
        scene = seen(medium, (MAPPED_SKY, DARK_SUN), eye=(0.3, -0.4, 0.2))
        seed = seed_of("furnace", technique, colours, albedo)
        results.append(render(scene, spp=1 << 14, seed=seed, **choices))
        assert results[-1].metadata["technique"] == technique
        assert results[-1].metadata["transmittance"] == transmittance
    return results


@pytest.mark.contract
@pytest.mark.parametrize("colours", COLOURS)
@pytest.mark.parametrize(("technique", "transmittance", "absorption"), FURNACES)
def test_nothing_shows_in_a_furnace(technique, transmittance, absorption, colours):
    for result in furnaces(technique, transmittance, absorption, colours):
        assert_matches(result, SKY, bias=0.012)


@pytest.mark.contract
@pytest.mark.parametrize("case", FURNACES, ids="-".join)
def test_half_a_percent_would_show_in_the_furnaces_of_a_technique(case):
    pictures = [result for colours in COLOURS for result in furnaces(*case, colours)]
    assert_pooled([(result, SKY) for result in pictures])
    for factor in (0.995, 1.005):
        with pytest.raises(AssertionError, match="together"):
            assert_pooled([(result, factor * np.array(SKY)) for result in pictures])


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


def absorbing_emitter(sigma, radiance):
    """What a homogeneous one shows, which needs no technique, and L_e (1 - exp(-sigma L))."""
    medium = homogeneous(sigma, 0.0)
    radiance = tuple(np.atleast_1d(radiance).astype(float))
    medium = Medium(medium.sigma_t, medium.albedo, emission=ConstVolume(radiance))
    answer = np.array(radiance) * -np.expm1(-2.0 * np.atleast_1d(sigma))
    return render(narrow(medium), spp=1 << 18, seed=4), answer


def test_a_grey_homogeneous_absorbing_emitter_has_no_noise():
    """Every sample is the closed form, and their sum is exact."""
    result, answer = absorbing_emitter(1.3, 2.0)
    np.testing.assert_allclose(result.image, np.broadcast_to(answer, result.image.shape), rtol=1e-6)
    assert not result.variance.any()


def test_a_coloured_homogeneous_absorbing_emitter_is_its_closed_form():
    assert_matches(*absorbing_emitter((2.0, 1.0, 0.2), (1.0, 2.0, 3.0)), bias=0.006)


TINTS = {"grey": (1.0,), "coloured": (2.0, 1.0, 0.4)}


@functools.cache
def ramp(technique, transmittance, absorption, colours):
    """A density that grows linearly along the view, and what it shows: tau = (s0 + s1) L / 2, ends added.

    The ends are clamped.
    """
    profile, tint = np.linspace(0.1, 1.0, 33), TINTS[colours]
    shares = np.array(tint) * (np.linspace(0.999, 1, 33)[:, None] if len(tint) > 1 else 1)
    values = profile[:, None] * shares.reshape(-1, len(tint))  # not proportional: three channels
    edge = 2.0 / 33
    tau = edge * (values[:-1] + values[1:]).sum(axis=0) / 2 + edge / 2 * (values[0] + values[-1])
    grid = np.broadcast_to(values[:, None, None], (33, 3, 4, len(tint)))
    emission = {"emission": ConstVolume((1.7, 1.7, 1.6))}
    medium = emitting(volume(grid if len(tint) > 1 else grid[..., 0], *CUBE), (0.0,), (1.5,), **emission)
    choices = {"technique": technique, "transmittance": transmittance, "absorption": absorption}
    result = render(narrow(medium), spp=1 << 17, seed=seed_of("ramp", technique, colours), **choices)
    return result, np.array([1.7, 1.7, 1.6]) * -np.expm1(-1.5 * tau)


@pytest.mark.contract
@pytest.mark.parametrize("colours", TINTS)
@pytest.mark.parametrize("case", FURNACES, ids="-".join)
def test_an_absorbing_emitting_ramp_is_its_closed_form(case, colours):
    assert_matches(*ramp(*case, colours), bias=0.01)


@pytest.mark.contract
@pytest.mark.parametrize("case", FURNACES, ids="-".join)
def test_half_a_percent_would_show_in_the_ramps_of_a_technique(case):
    pictures = [ramp(*case, colours) for colours in TINTS]
    assert_pooled(pictures)
    for factor in (0.995, 1.005):
        with pytest.raises(AssertionError, match="together"):
            assert_pooled([(result, factor * answer) for result, answer in pictures])


@pytest.mark.contract
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


@functools.cache
def slabs(technique, transmittance):
    """Pictures of slabs with what is published of them: R in red, T in green, both in blue."""
    pictures = []
    for albedo, g, thickness, reflected, transmitted in SLABS:
        scene = graded_slab(albedo, g, thickness, (1, 0, 1), (0, 1, 1))
        seed = seed_of("slab", technique, albedo, g)
        result = render(scene, spp=1 << 16, seed=seed, technique=technique, transmittance=transmittance)
        pictures.append((result, (reflected, transmitted, reflected + transmitted)))
    return pictures


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "transmittance"), PAIRS)
def test_slabs_reflect_and_transmit_what_is_published(technique, transmittance):
    bound = largest_z(2 * len(SLABS))
    for result, (reflected, transmitted, _) in slabs(technique, transmittance):
        (r, t, _), error = mean_and_error(result)
        require_precision(error[:2], 0.00095, "R and T")
        assert abs(z_score(r, error[0] ** 2, reflected)) < bound, f"R = {r:.5f} ± {error[0]:.5f}"
        assert abs(z_score(t, error[1] ** 2, transmitted)) < bound, f"T = {t:.5f} ± {error[1]:.5f}"


@pytest.mark.contract
def test_half_a_percent_would_show_in_the_slabs_of_all_techniques():
    assert_pooled([picture for pair in PAIRS for picture in slabs(*pair)])


@functools.cache
def half_spaces(technique, transmittance):
    """Extinction 6 : 3 : 1 does not show in a half-space; each channel is thick enough for its albedo."""
    pictures = []
    for albedo, spp in ((0.99, 0.9, 0.5), 1 << 14), ((0.8, 0.8, 0.5), 1 << 13):
        scene = graded_slab(albedo, 0.0, 25.0, (1, 1, 1), (0, 0, 0), (6.0, 3.0, 1.0), edge=500.0)
        seed = seed_of("half-space", technique, albedo)
        result = render(scene, spp=spp, seed=seed, technique=technique, transmittance=transmittance)
        assert result.stats["paths_cut_by_max_depth"] == result.stats["non_finite"] == 0
        pictures.append((result, np.array([HALF_SPACES[a] for a in albedo])))
    return pictures


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "transmittance"), PAIRS)
def test_half_spaces_of_three_colours_reflect_what_chandrasekhar_says(technique, transmittance):
    for result, expected in half_spaces(technique, transmittance):
        mean, error = mean_and_error(result)
        require_precision(error, 0.012 * expected, "R")
        z = np.abs(z_score(mean, error**2, expected))
        assert z.max() < largest_z(6), f"{mean} ± {error}, not {expected}"


@pytest.mark.contract
def test_eight_tenths_of_a_percent_would_show_in_the_half_spaces_of_all_techniques():
    assert_pooled([picture for pair in PAIRS for picture in half_spaces(*pair)], bias=0.008)


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "transmittance"), PAIRS)
def test_a_white_slab_loses_nothing(technique, transmittance):
    assert_a_white_slab_loses_nothing(technique, transmittance)


# -- the sampler that users get ----------------------------------------------------------------------

SEEDS, FEW = 16, (SLABS[1], SLABS[3])


@functools.cache
def of_seeds(technique, transmittance):
    """Relative deviations of R and T from what is published, mean of two slabs: (seeds, 2).

    Samples of `sobol` are not independent, whole renders of different seeds are.
    """
    options = {"technique": technique, "transmittance": transmittance, "sampler": "sobol"}
    found = np.zeros((SEEDS, 2))
    for albedo, g, thickness, *published in FEW:
        scene = graded_slab(albedo, g, thickness, (1, 0, 1), (0, 1, 1))
        for n in range(SEEDS):
            result = render(scene, spp=1 << 12, seed=seed_of("sobol", technique, albedo, n), **options)
            assert result.metadata["sampler"] == "sobol"
            found[n] += (mean_and_error(result)[0][:2] / published - 1) / len(FEW)
    return found


def assert_centred(deviations, bias):
    """Student's t of each column, at a joint false-alarm rate of 1e-4; a `bias` would have failed."""
    count, columns = deviations.shape
    error = deviations.std(axis=0, ddof=1) / count**0.5
    bound = stats.t.isf(sidak(FALSE_ALARM, columns) / 2, count - 1) * error
    mean = np.abs(deviations.mean(axis=0))
    assert (mean < bound).all(), f"{mean} with an error of {error}"
    require_precision(bound + mean, bias, "R and T")


@pytest.mark.contract
@pytest.mark.parametrize(("technique", "transmittance"), PAIRS)
def test_low_discrepancy_samples_show_what_is_published(technique, transmittance):
    assert_centred(of_seeds(technique, transmittance), bias=0.03)


@pytest.mark.contract
def test_half_a_percent_would_show_in_low_discrepancy_samples_of_all_techniques():
    found = np.concatenate([of_seeds(*pair) for pair in PAIRS])
    assert_centred(found, bias=0.005)
    with pytest.raises(AssertionError, match="with an error"):
        assert_centred(found + 0.005, bias=0.005)
