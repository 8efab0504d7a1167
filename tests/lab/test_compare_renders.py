"""Comparisons of real renders: what unbiased techniques and equals must look like, and what must not.

No wall clock decides: errors are measured over samples and renders, times are made up.  Seeds are fixed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pictures import box, gridded, picture, volume
from scipy import stats
from stat_tests import FALSE_ALARM, sidak

import clvol
from clvol.lab.comparison.entrants import Render
from clvol.lab.comparison.figures import LEVEL, Figures, compute_figures
from clvol.lab.comparison.measure import Measured
from clvol.lab.comparison.reference import Reference
from clvol.lab.comparison.shorter import render_slope, slope_spp
from clvol.lab.efficiency import error_products, fitted_slope
from clvol.lab.trials import Trial
from clvol.planning.choices import Choices
from clvol.planning.registry import TECHNIQUES
from clvol.scene.records import ConstantEmitter, Scene

if TYPE_CHECKING:
    from clvol.lab.comparison.result import Comparison
    from clvol.lab.statistics import Interval

pytestmark = pytest.mark.contract

UNBIASED = [name for name, choice in TECHNIQUES.items() if not choice.biased]


def cube(size: int) -> Scene:
    """A cube of 4³ voxels in thin and dense slabs fills the picture; red is attenuated most, blue least."""
    slabs = np.array([1.2, 10.8, 1.2, 10.8])[:, None, None, None]
    density = slabs * np.random.default_rng(1).random((4, 4, 4, 1)) * (1.0, 0.7, 0.5)
    medium = gridded(volume(density, (0, 0, 0), (1, 1, 1)), albedo=0.4)
    eye, target, sky = (0.5, 0.5, -1.4), (0.5, 0.5, 0.5), ConstantEmitter((1.0, 1.0, 1.0))
    return picture([box((0, 0, 0), (1, 1, 1), medium)], [sky], eye, target, fov=35.0, size=(size, size))


# ---- error over samples and renders

JOINT_RATE = 0.01
"""Of a false alarm over all slopes below together (Šidák), 0.07 % each: made-up normal errors of 24 and of 32
rounds, against a reference of ten times their samples, missed slope -1 in 2 and 5 of 6000 comparisons."""
LEVEL_OF_ONE = 1 - sidak(JOINT_RATE, 2 * len(UNBIASED))


@pytest.fixture(scope="module")
def comparison(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    """Every technique, marching in steps as long as the cube, against a reference.

    That has a twelfth of the variance of their rounds' means.
    """
    path, scene = tmp_path_factory.mktemp("reference") / "reference.exr", cube(24)
    clvol.render(scene, spp=2048, technique="regular", sampler="sobol", seed=10**9).save(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("clvol.lab.comparison.entrants._TRIAL_SECONDS", 0.0)  # trials as short as can be
        return clvol.compare(
            scene,
            techniques=list(TECHNIQUES),
            sampler="independent",
            spp=16,
            rounds=24,
            reference=path,
            step=1.0,
            seed=1,
        )


def slopes(figures: Figures, reference: Reference, level: float, bright: float = 1.0) -> list[Interval]:
    """Over renders and over samples; with `bright`, of pictures that are too bright by that factor."""
    measured = figures.measured
    rounds = {measured.spp: measured.images}
    rounds |= {spp: measured.shorter[spp].images for spp in slope_spp(measured.spp)}
    products = {
        spp: error_products(bright * images, reference.image, reference.variance)
        for spp, images in rounds.items()
    }
    errors = {spp: np.diag(of_pairs) for spp, of_pairs in products.items()}
    return [fitted_slope(products[measured.spp], level), render_slope(errors, level)]


def test_without_bias_errors_fall_with_slope_minus_one(comparison: Comparison) -> None:
    """Over renders and over samples, for every unbiased technique.

    In bands narrow enough to mean something: of pictures a twentieth too bright they would not hold -1.
    """
    for name in UNBIASED:
        figures = comparison[name]
        assert figures.verdict.agrees, figures.verdict
        for band in slopes(figures, comparison.reference, LEVEL_OF_ONE):
            assert band.low <= -1 <= band.high, (name, band)
            assert band.high - band.low < 0.3, (name, band)
        assert slopes(figures, comparison.reference, LEVEL_OF_ONE, bright=1.05)[0].low > -1
        assert [figures.slope, figures.render_slope] == slopes(figures, comparison.reference, 0.95)


def test_costs_are_proportional_to_renders(comparison: Comparison) -> None:
    """So that slopes over renders are those over look-ups, and over seconds but for precomputation."""
    for figures in comparison.figures:
        seconds, count = figures.measured.seconds, np.arange(1, 25)
        np.testing.assert_allclose(np.diff(figures.seconds), seconds.mean())
        np.testing.assert_allclose(figures.lookups, count * figures.lookups[0])


def test_marching_flattens_and_the_report_says_so(comparison: Comparison) -> None:
    marching = comparison["marching"]
    for band in slopes(marching, comparison.reference, LEVEL_OF_ONE):
        assert band.low > -0.8
    assert marching.biased and not marching.verdict.agrees
    [flattens] = [text for text in comparison.words if "flattens" in text]
    assert flattens.startswith("marching flattens: ") and flattens.endswith("which is bias.")
    words = " ".join(comparison.words)
    assert "marching differs from the reference, as its label says" in words
    assert "slower than the -1 of independent samples" in words


# ---- a technique compared with itself

REPEATS, ROUNDS, SMALL = 40, 4, 8
Compared = Callable[[float], list[tuple[Figures, ...]]]


@pytest.fixture(scope="module")
def truth(device) -> Reference:
    """Of the small cube, with seeds that nothing else has."""
    trial = Trial.open(device, cube(SMALL), Choices(technique="regular", sampler="sobol"))
    return Reference.of_rounds(np.stack([trial.render(n, 1024).image for n in range(8)]), 1024, "test")


@pytest.fixture(scope="module", params=["independent", "sobol"])
def with_itself(request: pytest.FixtureRequest, device, truth: Reference) -> Compared:
    """Forty comparisons of delta under three names, each of renders of its own.

    The seconds are made up, with noise of each render and more of each round. Called with the factor by which
    those of c are too many.
    """
    spp = 4
    trial = Trial.open(device, cube(SMALL), Choices(technique="delta", sampler=request.param))
    trial = replace(trial, precompute_seconds=0.1)
    results = [trial.render(10 + n, spp) for n in range(3 * REPEATS * ROUNDS)]
    images = np.stack([r.image for r in results]).reshape(REPEATS, 3, ROUNDS, *results[0].image.shape)
    lookups = np.array([float(r.stats["lookups"]) for r in results]).reshape(REPEATS, 3, ROUNDS)
    picture = Render(images[0, 0, 0], 1.0, 1.0, 0, spp)
    random = np.random.default_rng(1)
    of_rounds = np.exp(0.3 * random.standard_normal((REPEATS, 1, ROUNDS)))
    seconds = of_rounds * np.exp(0.1 * random.standard_normal((REPEATS, 3, ROUNDS)))

    def compared(slower: float) -> list[tuple[Figures, ...]]:
        spent = seconds * np.array([1.0, 1.0, slower])[:, None]
        return [
            compute_figures(
                [
                    Measured(
                        label, trial, spp, images[r, n], spent[r, n], lookups[r, n], (0,) * ROUNDS, picture
                    )
                    for n, label in enumerate("abc")
                ],
                truth,
                "a",
            )
            for r in range(REPEATS)
        ]

    return compared


def test_a_technique_does_not_differ_significantly_from_itself(with_itself: Compared) -> None:
    """At most so many of forty comparisons call b or c different as a rate of 5 % allows, by either cost.

    A false alarm of the four counts, two for each sampler, once in 10,000.
    """
    found, most = with_itself(1.0), stats.binom.isf(FALSE_ALARM / 4, REPEATS, LEVEL)
    for cost in ("seconds", "lookups"):
        family = [[f.efficiency[cost] for f in figures[1:]] for figures in found]
        assert sum(any(e.significant for e in pair) for pair in family) <= most
        for e in (e for pair in family for e in pair):
            assert e.adjusted_p >= e.p and (e.p < 0.05) == (not e.ratio.low <= 1 <= e.ratio.high)


def test_a_cost_that_is_there_is_called_significant(with_itself: Compared) -> None:
    """Four times the seconds are found in most comparisons, by time alone."""
    found, most = with_itself(4.0), stats.binom.isf(FALSE_ALARM / 4, REPEATS, LEVEL)
    by = {cost: sum(f[2].efficiency[cost].significant for f in found) for cost in ("seconds", "lookups")}
    assert by["seconds"] > REPEATS / 2 > most >= by["lookups"]
    assert all(f[2].efficiency["seconds"].ratio.value < 1 for f in found)
