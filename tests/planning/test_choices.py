"""What `auto` takes, what is refused and why, and that nothing chosen is ignored in silence."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from pictures import box, gridded, homogeneous, picture, volume
from stat_tests import assert_same_picture
from tiers import quick_first

import clvol
from clvol import render
from clvol.errors import OptionError
from clvol.planning.choices import Choices
from clvol.planning.in_force import warnings
from clvol.planning.plan import Plan
from clvol.scene.records import ConstantEmitter, ConstVolume, DirectionalEmitter

CUBE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
LUMPS = np.random.default_rng(1).random((5, 6, 7))
SKY, SUN = ConstantEmitter(), DirectionalEmitter((2.0,), (0.0, -1.0, 0.0))


def scene(scale=(3.0,), lights=(SKY, SUN), more=(), filter_type="trilinear"):
    medium = gridded(volume(LUMPS, *CUBE, filter_type), 0.7, scale=scale)
    return picture([box(*CUBE, medium), *more], lights, (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (4, 4))


OVERLAPPING = scene(more=[box((0.5, 0, 0), (1.5, 1, 1), homogeneous(1.0, 0.5))])


@pytest.mark.parametrize(
    ("described", "technique", "transmittance"),
    [
        (scene(), "delta", "ratio"),
        (scene(lights=(SKY,)), "delta", "none"),
        (scene((3.0, 2.0, 1.0)), "delta", "ratio"),
        (OVERLAPPING, "delta", "ratio"),
    ],
    ids=["grey", "under a sky", "chromatic", "overlapping"],
)
def test_auto_follows_the_rules_that_are_written_down(described, technique, transmittance):
    found = Plan.of(described).chosen
    assert (found["technique"], found["transmittance"]) == (technique, transmittance)
    assert (found["lookup"], found["absorption"], found["roulette"]) == ("exact", "mixed", "depth")
    assert (found["probability"], found["control"]) == ("history", "mean")


def glowing(albedo=0.5, scale=(3.0,), more=()):
    medium = gridded(volume(LUMPS, *CUBE), albedo, scale=scale)
    medium = replace(medium, emission=ConstVolume((1.0,)))
    return picture([box(*CUBE, medium), *more], [SKY], (0.4, 0.5, -3.0), (0.5, 0.5, 0.5), 30.0, (4, 4))


@pytest.mark.parametrize(
    ("described", "asked", "technique"),
    [
        (glowing(), {}, "regular"),
        (glowing(), {"sampler": "independent"}, "delta"),
        (glowing(), {"lookup": "stochastic"}, "delta"),
        (glowing(), {"technique": "delta"}, "delta"),
        (glowing(albedo=(0.5, 0.5, 0.6)), {}, "delta"),
        (glowing(scale=(3.0, 2.0, 1.0)), {}, "delta"),
        (glowing(more=[box((2, 0, 0), (3, 1, 1), homogeneous(1.0, 0.9))]), {}, "regular"),
        (glowing(more=[box((0.5, 0, 0), (1.5, 1, 1), homogeneous(1.0, 0.5))]), {}, "delta"),
        (scene(), {}, "delta"),
    ],
)
def test_auto_takes_exact_flights_where_low_discrepancy_samples_meet_dark_media_that_glow(
    described, asked, technique
):
    found = Plan.of(described, Choices(**{"sampler": "sobol"} | asked)).chosen
    assert found["technique"] == technique


@pytest.mark.parametrize(
    ("described", "choices", "why", "instead"),
    [
        (scene(), {"transmittance": "none"}, "point, spot and directional", "ratio"),
        (scene(), {"majorant_scale": 0.9}, "bounds are too low", "weighted-delta"),
        (scene(), {"majorant_scale": 0.9, "technique": "decomposition"}, "too low", "weighted-delta"),
        (
            scene(),
            {"majorant_scale": 0.9, "technique": "spectral", "transmittance": "delta"},
            "transmittance 'delta' is biased",
            "ratio",
        ),
        (scene(), {"lookup": "stochastic", "technique": "regular"}, "not linear", "exact"),
        (scene(), {"lookup": "stochastic", "transmittance": "regular"}, "not linear", "exact"),
        (scene(), {"lookup": "stochastic", "technique": "marching"}, "not linear", "exact"),
        (scene(), {"step": 0.1}, "nothing marches", "marching"),
        (scene(), {"step": -1.0, "technique": "marching"}, "positive number", ""),
        (scene(), {"majorant_scale": 0.0}, "positive number", ""),
        (scene(), {"majorant_scale": float("nan")}, "positive number", ""),
        (scene(), {"majorant_scale": "2"}, "positive number", ""),
        (scene(), {"aov": ["cels"]}, "unknown aov 'cels'", "cells"),
        (scene(), {"technique": "spectrall"}, "unknown technique", "did you mean 'spectral'"),
        (scene(), {"probability": "min"}, "unknown probability", "history"),
    ],
    ids=lambda value: ",".join(f"{k}={v}" for k, v in value.items()) if isinstance(value, dict) else None,
)
def test_what_cannot_be_right_is_refused_with_a_reason_and_a_way_out(described, choices, why, instead):
    with pytest.raises(OptionError) as caught:
        render(described, spp=1, **choices)
    assert why in str(caught.value) and instead in str(caught.value)


@quick_first(("technique", "transmittance"), [("marching", "ratio"), ("delta", "marching")])
def test_marching_says_that_it_is_biased_and_a_fine_step_is_near_the_truth(technique, transmittance, caplog):
    thick = scene((30.0,))
    with caplog.at_level(logging.WARNING, "clvol"):
        marched = render(thick, spp=1024, technique=technique, transmittance=transmittance, step=0.01)
    assert "BIASED" in caplog.text
    assert "marching" in marched.metadata["biased"] and marched.metadata["step"] == 0.01
    truth = render(thick, spp=1024, seed=2)
    assert "biased" not in truth.metadata
    assert marched.image.mean() == pytest.approx(truth.image.mean(), rel=0.02)


def test_the_label_of_a_biased_picture_is_in_the_file(tmp_path):
    result = render(scene(), spp=2, technique="marching", step=0.1)
    result.save(tmp_path / "a.exr")
    assert b"technique marching" in (tmp_path / "a.exr").read_bytes()


@pytest.mark.parametrize(
    ("choices", "word"),
    [
        ({"probability": "max"}, "probability max is not used"),
        ({"control": "min"}, "control min is not used"),
        ({"majorant_scale": 2.0, "technique": "marching", "transmittance": "marching"}, "majorant_scale"),
        ({"majorant": "grid", "technique": "marching", "transmittance": "marching"}, "majorant grid"),
    ],
)
def test_a_choice_without_use_is_answered_with_a_warning(choices, word, caplog):
    with caplog.at_level(logging.WARNING, "clvol"):
        render(scene(), spp=1, **choices)
    assert word in caplog.text and "not used" in caplog.text


def said_in_fog(sigma_t, **choices):
    """Warnings on homogeneous fog of coloured albedo, and the picture."""
    fog = picture(
        [box(*CUBE, homogeneous(sigma_t, (0.9, 0.5, 0.2)))], (SKY,), (0.4, 0.5, -3.0), (0.5, 0.5, 0.5)
    )
    plan = Plan.of(fog, Choices(**choices))
    image = render(fog, spp=4, seed=1, **choices).image
    return list(warnings(plan, choices)), image


@quick_first(
    ("sigma_t", "choices", "family", "names"),
    [
        (1.0, {}, "transmittance", ("none", "ratio")),
        ((1.0, 2.0, 3.0), {"absorption": "sample"}, "probability", ("history", "max")),
        ((9.0, 9.0, 1e-5), {}, "technique", ("delta", "spectral")),
        (1.0, {}, "technique", ("delta", "decomposition")),
        (1.0, {"transmittance": "ratio"}, "control", ("mean", "min")),
        (1.0, {}, "majorant", ("global", "grid")),
        ((1.0, 2.0, 3.0), {}, "probability", ("history", "max")),
    ],
    count=3,
)
def test_what_is_said_to_have_no_use_changes_nothing_and_nothing_else_does(sigma_t, choices, family, names):
    """Each pair of choices makes two pictures unless the second is said not to be used."""
    (_, first), (said, second) = (said_in_fog(sigma_t, **choices, **{family: name}) for name in names)
    unused = any(text.startswith(f"{family} {names[1]} is not used") for text in said)
    assert np.array_equal(first, second) == unused


def test_shadow_rays_through_homogeneous_media_are_said():
    said, _ = said_in_fog(1.0, transmittance="ratio")
    assert said == ["transmittance ratio: shadow rays, whose transmittance is analytic here"]


def test_stochastic_lookups_of_a_nearest_filter_have_no_use(caplog):
    with caplog.at_level(logging.WARNING, "clvol"):
        result = render(scene(filter_type="nearest"), spp=1, lookup="stochastic")
    assert result.metadata["lookup"] == "none" and "lookup stochastic is not used" in caplog.text


def test_a_majorant_scaled_up_shows_the_same_and_costs_more():
    plain, loose = (render(scene(), spp=512, seed=3, majorant_scale=s, majorant="grid") for s in (1.0, 3.0))
    assert loose.stats["lookups"] > 1.5 * plain.stats["lookups"]
    assert loose.metadata["majorant_scale"] == 3.0 and "majorant_scale" not in plain.metadata
    assert loose.image.mean() == pytest.approx(plain.image.mean(), rel=0.03)
    with pytest.raises(clvol.Error, match="majorant_scale"):
        clvol.merge([plain, render(scene(), samples=(512, 8), seed=3, majorant_scale=3.0, majorant="grid")])


@pytest.mark.contract
def test_largest_weights_merge_by_their_maximum_and_counts_by_their_mean():
    options = {"technique": "spectral", "aov": ("largest_weight", "tentative"), "seed": 4}
    described = scene((6.0, 3.0, 1.0))
    whole = render(described, spp=24, **options)
    parts = [render(described, samples=part, **options) for part in ((0, 8), (8, 16))]
    merged = clvol.merge(parts)
    for name in ("largest_weight", "tentative"):
        assert np.allclose(merged.aovs[name], whole.aovs[name], rtol=1e-6)
    assert merged.stats["largest_weight"] == whole.stats["largest_weight"]
    assert merged.stats["tentative_collisions"] == whole.stats["tentative_collisions"]


def test_energy_lost_to_caps_merges_as_a_mean():
    described = picture(
        [box(*CUBE, gridded(volume(LUMPS, *CUBE), 0.9, scale=9.0))],
        (SKY,),
        (0.4, 0.5, -3.0),
        (0.5, 0.5, 0.5),
        size=(4, 4),
        max_depth=3,
    )
    whole = render(described, spp=24)
    merged = clvol.merge([render(described, samples=part) for part in ((0, 8), (8, 16))])
    assert merged.stats["energy_lost_to_caps"] == pytest.approx(whole.stats["energy_lost_to_caps"], rel=1e-5)


@pytest.mark.contract
@pytest.mark.parametrize("technique", ["decomposition", "regular"])
def test_techniques_without_weights_walk_overlapping_media(technique):
    results = [render(OVERLAPPING, spp=2048, seed=n, technique=t) for n, t in enumerate(("delta", technique))]
    assert_same_picture(*results, tile=4)


def test_choices_are_checked_when_they_are_made():
    with pytest.raises(OptionError, match="unknown majorant"):
        Choices(majorant="octree")
    assert Choices(aov="cells").aov == ("cells",)


@quick_first("majorant", ["grid", "global", "kdtree"])
def test_a_majorant_scaled_down_is_violated_and_counted(majorant):
    low, sound = (
        clvol.render(
            scene(), spp=16, seed=1, technique="weighted-delta", majorant=majorant, majorant_scale=scale
        ).stats
        for scale in (0.4, 1.0)
    )
    assert sound["majorant_violations"] == 0 < low["majorant_violations"]
    assert low["tentative_collisions"] < sound["tentative_collisions"]
