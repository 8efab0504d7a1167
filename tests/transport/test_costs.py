"""What techniques cost, counted: look-ups, variances, weights."""

import numpy as np
import pytest
from fields import RAYS, exit_distance, trilinear
from pictures import box, gridded, picture, volume
from probe import Probe, grid_volume, medium_of, scene_of
from tiers import quick_first
from walks import sample_walks, transmittance_walks, unbiased

from clvol import render
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter, Medium

RAY = RAYS["oblique"]
LENGTH = exit_distance(*RAY)
CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)


def over_a_base(base):
    """Ripples of height 1 - base over a constant base: every cell meets both."""
    ripples = np.indices((32, 32, 32)).sum(axis=0) % 2
    return (base + (1 - base) * ripples).astype(np.float32)


@pytest.mark.parametrize("base", [0.3, 0.6, 0.8])
def test_lookups_of_decomposition_fall_as_the_control_rises(device, base):
    """(sigma_maj - sigma_c) / sigma_maj of delta's, for the same tentative collisions (METHODS §3)."""
    scene, lookups = scene_of(medium_of(over_a_base(base), 6.0)), {}
    for technique in ("delta", "decomposition"):
        probe = Probe(device, scene, technique=technique, majorant="grid")
        *_, found = sample_walks(probe, RAY, LENGTH, 1 << 20)
        lookups[technique] = found.mean()
    assert lookups["decomposition"] / lookups["delta"] == pytest.approx(1 - base, rel=0.01)


@pytest.mark.parametrize("technique", ["decomposition", "weighted-decomposition", "spectral-decomposition"])
def test_a_constant_medium_is_sampled_without_lookups(device, technique):
    probe = Probe(device, scene_of(medium_of(np.full((9, 9, 9), 0.5), 5.0)), technique=technique)
    *_, lookups = sample_walks(probe, RAY, LENGTH, 1 << 16)
    assert lookups.mean() < 1e-3


def test_residual_ratio_is_best_where_the_control_is_the_mean(device):
    """At one residual majorant the relative variance is exp(integral of (sigma - c)² / sigma_maj_r) - 1."""
    density = over_a_base(0.2)
    scene = scene_of(medium_of(density, 0.7, 0.5))
    probe = Probe(device, scene, transmittance="residual-ratio", majorant="global")
    (cells,) = probe.prepared.majorants
    mean, variances = float(cells.residual[0, 0]), {}
    t = (np.arange(20_000) + 0.5) * (LENGTH / 20_000)
    along = trilinear(density, RAY[0] + t[:, None] * RAY[1])
    assert along.mean() == pytest.approx(mean, rel=0.02)
    for factor in (0.5, 0.75, 1.0, 1.25, 1.5):
        cells.residual[0] = factor * mean, 0.9
        probe.upload()
        values = transmittance_walks(probe, RAY, LENGTH, 1 << 20)[0][:, 0].astype(float)
        variances[factor] = values.var() / values.mean() ** 2
        predicted = np.expm1(0.7 * LENGTH * ((along - factor * mean) ** 2).mean() / 0.9)
        assert variances[factor] == pytest.approx(predicted, rel=0.05)
    assert min(variances, key=variances.get) == 1.0


def test_a_control_of_the_mean_beats_those_of_the_extrema(device):
    scene, variances = scene_of(medium_of(over_a_base(0.2), 4.0, 0.5)), {}
    for control in ("mean", "min", "max"):
        probe = Probe(device, scene, transmittance="residual-ratio", control=control, majorant="grid")
        values, _, lookups = transmittance_walks(probe, RAY, LENGTH, 1 << 18)
        variances[control] = values.var() * lookups.mean()
    assert min(variances, key=variances.get) == "mean"


def test_regular_transmittance_has_no_variance(device):
    rng = np.random.default_rng(5)
    probe = Probe(device, scene_of(medium_of(rng.random((20, 21, 22)), 9.0, 0.5)), transmittance="regular")
    values, _, _ = transmittance_walks(probe, RAY, LENGTH, 1 << 12)
    assert np.ptp(values) == 0


def test_stochastic_lookups_cost_noise_and_no_more_lookups(device):
    rng, cost = np.random.default_rng(6), {}
    scene = scene_of(medium_of(rng.random((20, 21, 22)), 1.5, 0.5))
    for lookup in ("exact", "stochastic"):
        probe = Probe(device, scene, transmittance="ratio", lookup=lookup)
        values, _, lookups = transmittance_walks(probe, RAY, LENGTH, 1 << 18)
        cost[lookup] = values.var(), lookups.mean()
    assert cost["stochastic"][0] > cost["exact"][0]
    assert cost["stochastic"][1] < 1.01 * cost["exact"][1]


def chromatic_scene(albedo):
    """Extinction 1000 : 30 : 1 by a grid of different lumps in each channel."""
    lumps = np.random.default_rng(8).random((12, 12, 12, 3)) ** 2 * [1.0, 0.03, 0.001]
    medium = Medium(grid_volume(lumps), ConstVolume(albedo), 40.0, homogeneous=False)
    return scene_of(medium, (ConstantEmitter(), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))))


@quick_first("absorption", ["sample", "weight"])
@quick_first("technique", ["spectral", "regular"])
def test_with_history_no_weight_exceeds_the_number_of_channels(technique, absorption):
    scene = chromatic_scene((0.99, 0.9, 0.999))
    no_roulette = type(scene.integrator)(rr_depth=1_000_000)
    scene = type(scene)(**{**vars(scene), "integrator": no_roulette})
    result = render(scene, spp=256, technique=technique, absorption=absorption, majorant="grid")
    assert result.stats["majorant_violations"] == 0
    assert result.stats["largest_weight"] <= 3 * (1 + 1e-4)


def white_chromatic_scene(albedo=1.0):
    lumps = np.random.default_rng(8).random((8, 8, 8)) ** 2
    medium = Medium(grid_volume(lumps), ConstVolume((albedo,)), (20.0, 10.0, 3.0), homogeneous=False)
    return scene_of(medium)


@pytest.mark.parametrize("technique", ["spectral", "spectral-decomposition", "regular"])
def test_at_albedo_one_under_a_white_sky_weights_make_no_noise(technique):
    """The control variate knows what every path will see."""
    result = render(white_chromatic_scene(), spp=64, technique=technique)
    assert result.stats["largest_weight"] > 1.5
    assert np.abs(result.image - 1).max() < 1e-4


@pytest.mark.contract
def test_the_background_lowers_the_noise_and_leaves_the_mean(monkeypatch):
    from stat_tests import assert_same_picture

    with_it = render(white_chromatic_scene(0.9), spp=512, technique="spectral", seed=1)
    monkeypatch.setattr("clvol.tables.media.expected_albedo", lambda medium: np.zeros(3))
    without = render(white_chromatic_scene(0.9), spp=512, technique="spectral", seed=2)
    assert_same_picture(with_it, without, tile=4)
    assert with_it.variance.mean() < 0.5 * without.variance.mean()


def test_a_limit_of_depth_leaves_no_background():
    scene = white_chromatic_scene(0.9)
    scene = type(scene)(**{**vars(scene), "integrator": type(scene.integrator)(max_depth=0)})
    assert (render(scene, spp=4, technique="spectral").image == 0).all()


@quick_first("rule", ["max", "average"])
def test_with_other_rules_weights_do_exceed_it(rule):
    """The same scene: what `history` is there for."""
    result = render(chromatic_scene((0.99, 0.9, 0.999)), spp=64, technique="spectral", probability=rule)
    assert result.stats["largest_weight"] > 10


def test_counts_of_a_render_add_up():
    scene = chromatic_scene((0.9,))
    result = render(
        scene, spp=8, technique="delta", aov=("null", "cells", "largest_weight", "tentative", "real")
    )
    stats = result.stats
    assert stats["tentative_collisions"] == stats["null_collisions"] + stats["real_collisions"]
    assert stats["lookups"] == stats["tentative_collisions"] > 0
    pixels = result.image.shape[0] * result.image.shape[1]
    for name, total in (("null", "null_collisions"), ("cells", "cells_crossed"), ("lookups", "lookups")):
        assert result.aovs[name].sum(dtype=float) * 8 == pytest.approx(stats[total], rel=1e-5)
        assert result.aovs[name].shape == result.image.shape[:2]
    assert result.aovs["largest_weight"].max() == pytest.approx(stats["largest_weight"])
    assert stats["paths"] == 24 * pixels, "a path for each channel of a sample"
    assert stats["largest_sample"] >= result.image.max()


def test_pictures_of_variance_and_efficiency_are_those_of_the_estimate():
    """Variance is that of a sample.

    1 / (efficiency · variance of the pixel) adds up to the stages' seconds, and is a pixel's share of them:
    even where stages have no media to walk, by work where they have.
    """
    result = render(chromatic_scene((0.9,)), spp=8, aov=("variance", "efficiency", "cells"))
    of_pixels = result.variance.mean(axis=-1)
    np.testing.assert_allclose(result.aovs["variance"], 8 * of_pixels, rtol=1e-5)
    known = of_pixels > 0
    assert known.mean() > 0.5
    assert (result.aovs["efficiency"][~known] == 0).all()
    spent = 1 / (result.aovs["efficiency"][known].astype(float) * of_pixels[known])
    parts = result.stats["seconds"]
    stages = {name: parts[name] for name in parts if name not in ("setup", "kernels", "render")}
    walking = stages["medium_sample"] + stages["shadow_transmittance"]
    work = (result.aovs["lookups"] + result.aovs["cells"]).astype(float)
    share = work / work.sum()
    expected = walking * share + (sum(stages.values()) - walking) / share.size
    np.testing.assert_allclose(spent, expected[known], rtol=1e-4)


def test_counts_are_the_same_whether_a_picture_shows_them_or_not():
    scene = chromatic_scene((0.9,))
    shown = render(scene, spp=8, technique="spectral", aov=("violations", "cells", "tentative", "real"))
    hidden = render(scene, spp=8, technique="spectral")
    assert (shown.image == hidden.image).all()
    for name in (
        "tentative_collisions",
        "real_collisions",
        "cells_crossed",
        "majorant_violations",
        "lookups",
    ):
        assert shown.stats[name] == hidden.stats[name]


@pytest.mark.contract
@pytest.mark.parametrize("technique", unbiased("technique"))
def test_weighted_techniques_stay_right_below_the_bound_and_analog_ones_refuse(technique):
    from pictures import assert_matches

    from clvol.errors import OptionError
    from clvol.planning import registry

    values = np.random.default_rng(3).uniform(0.0, 1.0, (6, 5, 4)) ** 2
    medium = gridded(volume(values, *CUBE), 1.0, scale=1.5)
    scene = picture([box(*CUBE, medium)], (ConstantEmitter(),), (0.5, 0.8, -4.0), (0, 0, 0), 24.0, (4, 4))
    choices = {"technique": technique, "transmittance": "none", "majorant_scale": 0.8}
    if registry.TECHNIQUES[technique].needs_bound:
        with pytest.raises(OptionError, match="bounds are too low"):
            render(scene, spp=1, **choices)
        return
    result = render(scene, spp=1 << 15, seed=5, **choices)
    result.stats["majorant_violations"] = 0  # they are the point
    assert_matches(result, 1.0)
