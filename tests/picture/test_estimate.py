"""Variances and noise from few independent randomisations: right on the mean, for numbers and in pictures.

False-alarm rate 1e-4 a test; seeds are fixed.  What the tests would reject is part of them.
"""

from functools import cache, reduce

import numpy as np
import pytest
from pictures import picture
from stat_tests import largest_z
from tiers import quick_first

import clvol
from clvol.lab.trials import Trial
from clvol.picture.estimate import Moments, Replicates, error_bias
from clvol.picture.result import relative_noise
from clvol.planning.choices import Choices
from clvol.scene.materials import Diffuse
from clvol.scene.records import Shape

# -- made-up numbers -------------------------------------------------------------------------------


def replicates(means, counts):
    """Of randomisations with these means (randomisations, …)."""
    counts = np.asarray(counts)
    return Replicates(np.asarray(means, float) * counts.reshape(-1, *[1] * (np.ndim(means) - 1)), counts)


def shares_of_variance(counts, variance=lambda r: r.mean_and_variance()[1]):
    """How often each randomisation's variance counts in the estimate's expectation, a quadratic form."""
    unit = np.eye(len(counts))
    return np.array([variance(replicates(row, counts)) for row in unit])


UNEQUAL = [
    (7, 7, 7, 6),
    (2, 1, 1, 1),
    (1, 1, 1, 0),
    (5, 5, 4, 4),
    (1, 1, 0, 0),
    (9, 8, 8, 8),
    (40, 3, 11, 30),
]


@pytest.mark.parametrize("counts", [(16, 16, 16, 16), *UNEQUAL])
def test_the_estimate_is_the_means_variance_whatever_the_variance_of_each_randomisation(counts):
    """The mean m = Σ n_r m_r / N has the variance Σ (n_r / N)² v_r."""
    expected = (np.array(counts) / sum(counts)) ** 2
    np.testing.assert_allclose(shares_of_variance(counts), expected, rtol=1e-12)
    means = np.random.default_rng(2).random((len(counts), 3))
    there, moved = (replicates(means + x, counts).mean_and_variance()[1] for x in (0.0, 5.0))
    np.testing.assert_allclose(there, moved, rtol=1e-9)


def by_sample(r):
    """Scatter of the means, each as often as it has samples: right only where more samples help as usual."""
    mean = r.sum_ / r.count
    known = r.counts > 0
    return (r.counts[known] * (r.sums[known] / r.counts[known] - mean) ** 2).sum() / (r.dof * r.count)


def test_counting_each_randomisation_by_its_samples_would_not_be_exact():
    exact = shares_of_variance((8, 8, 8, 7))
    np.testing.assert_allclose(shares_of_variance((8, 8, 8, 7), by_sample)[3] / exact[3], 8 / 7, rtol=1e-9)


@pytest.mark.parametrize("counts", [(2, 1, 0, 0), (6, 1, 1, 0), (4, 2, 1, 1)])
def test_where_one_has_half_of_the_samples_or_more_it_is_right_for_a_variance_by_samples(counts):
    found = shares_of_variance(counts)
    known = np.array(counts) > 0
    assert found[known] @ (1 / np.array(counts)[known]) == pytest.approx(1 / sum(counts), rel=1e-12)
    assert (found >= 0).all()


def test_scatter_of_equal_randomisations_is_the_textbooks():
    means = np.random.default_rng(3).random((4, 5, 3))
    mean, variance = replicates(means, (8,) * 4).mean_and_variance()
    np.testing.assert_allclose(mean, means.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(variance, means.var(axis=0, ddof=1) / 4, rtol=1e-12)


def test_one_randomisation_says_nothing_of_its_error():
    one = replicates([0.5, 0.0, 0.0, 0.0], (3, 0, 0, 0))
    assert one.dof == 0
    assert one.mean_and_variance() == (0.5, np.inf)
    assert np.isnan(error_bias(one.dof))


def test_parts_add_up_to_the_whole():
    rng = np.random.default_rng(4)
    samples, owner = rng.random((27, 6)), np.arange(27) % 4

    def part(first, until):
        own = [samples[first:until][owner[first:until] == r] for r in range(4)]
        return Replicates(np.array([s.sum(axis=0) for s in own]), np.array([len(s) for s in own]))

    merged = reduce(Replicates.plus, [part(0, 1), part(1, 14), part(14, 27)])
    whole = part(0, 27)
    assert merged.counts.tolist() == whole.counts.tolist() == [7, 7, 7, 6]
    assert (merged.count, merged.dof) == (27, 3)
    for one, other in zip(merged.mean_and_variance(), whole.mean_and_variance(), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 4, 200])
def test_noise_of_few_randomisations_is_the_true_one_on_the_mean(count):
    """Normal means with a known standard error: noise is that, and without its correction smaller."""
    pixels, error = 10_000, 0.1
    means = np.random.default_rng(count).normal(1.0, error * np.sqrt(count), (count, pixels))
    estimate = replicates(means, (1,) * count)
    noise = relative_noise(*estimate.mean_and_variance(), estimate.dof)
    spread = np.sqrt(1 / error_bias(estimate.dof) ** 2 - 1)
    assert abs(noise / error - 1) < largest_z(1) * np.sqrt(spread**2 / pixels + error**2 / pixels)
    uncorrected = relative_noise(*estimate.mean_and_variance())
    assert uncorrected / error == pytest.approx(error_bias(estimate.dof), rel=0.02)


def test_error_bias_is_the_known_c4():
    assert [round(error_bias(n), 4) for n in (1, 2, 3, 9)] == [0.7979, 0.8862, 0.9213, 0.9727]
    assert error_bias(1000) == pytest.approx(1 - 1 / 4000, rel=1e-6) and error_bias(1001) == 1.0


def test_independent_samples_leave_the_same_mean_and_the_usual_variance():
    samples = np.random.default_rng(6).random((27, 4))
    moments = Moments(samples.sum(axis=0), (samples**2).sum(axis=0), 27)
    mean, variance = moments.mean_and_variance()
    np.testing.assert_allclose(mean, samples.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(variance, samples.var(axis=0, ddof=1) / 27, rtol=1e-9)


# -- pictures ----------------------------------------------------------------------------------------

SEEDS = 48
UP, DOWN = (clvol.rotate((1, 0, 0), angle) for angle in (-90, 90))
FLOOR = Shape("rectangle", clvol.translate((0, -1, 0)) @ UP @ clvol.scale(3), bsdf=Diffuse((0.6,)))
LAMP = Shape("rectangle", clvol.translate((0.3, 0.2, 0.2)) @ DOWN @ clvol.scale(0.5), emission=(4.0,))


@pytest.fixture(scope="module")
def lamp_on_floor():
    """Floor beside a lamp and nothing else in view, so that all pixels count alike."""
    return picture([FLOOR, LAMP], [], (0.1, 1.1, -4.0), (0.2, -1, -1), 14.0, (20, 20), max_depth=3)


@pytest.fixture(scope="module")
def renders(device, lamp_on_floor):
    """Means and reported variances of independent renders: float64 (seeds, pixels) each."""
    trials = {s: Trial.open(device, lamp_on_floor, Choices(sampler=s)) for s in ("independent", "sobol")}

    @cache
    def rendered(sampler, spp):
        results = [trials[sampler].render(seed, spp) for seed in range(1, SEEDS + 1)]
        pick = lambda arrays: np.array([a[..., 0].astype(float).ravel() for a in arrays])  # noqa: E731
        return pick(r.image for r in results), pick(r.variance for r in results), results

    return rendered


def ratio_of_sums(top, bottom):
    """Ratio of the sums over pixels, which are independent, and its standard error."""
    ratio = top.sum() / bottom.sum()
    return ratio, np.sqrt(((top - ratio * bottom) ** 2).sum()) / bottom.sum()


@quick_first("spp", [64, 100, 27, 6], count=2)
def test_reported_variance_is_that_between_seeds(renders, spp):
    """A tenth too much or too little would be seen."""
    means, reported, _ = renders("sobol", spp)
    true = means.var(axis=0, ddof=1)
    ratio, error = ratio_of_sums(reported.mean(axis=0), true)
    bound = largest_z(1)
    assert abs(ratio - 1) < bound * error, f"{ratio} ± {error}"
    assert bound * error < 0.1


def test_the_variance_of_samples_taken_for_independent_would_be_rejected(renders):
    """Σ (x - m)² / (n (n - 1)) over all samples of a pixel is on the mean what independent ones report."""
    true = renders("sobol", 64)[0].var(axis=0, ddof=1)
    ratio, error = ratio_of_sums(renders("independent", 64)[1].mean(axis=0), true)
    assert ratio - 1 > largest_z(1) * error


def test_noise_is_the_true_standard_error_of_the_pixels(renders):
    """Without the correction for few degrees of freedom it would be seen to be too small."""
    means, reported, results = renders("sobol", 64)
    true = means.std(axis=0, ddof=1) / error_bias(SEEDS - 1)
    noises = np.sqrt(reported).mean(axis=0)
    ratio, error = ratio_of_sums(noises / error_bias(3), true)
    bound = largest_z(1)
    assert abs(ratio - 1) < bound * error, f"{ratio} ± {error}"
    uncorrected, error = ratio_of_sums(noises, true)
    assert 1 - uncorrected > bound * error
    expected = noises.sum() / error_bias(3) / means.mean(axis=0).sum()
    assert np.mean([r.noise for r in results]) == pytest.approx(expected, rel=1e-3)


def test_low_discrepancy_makes_an_area_lamps_light_much_quieter(renders):
    """Direct light on a diffuse floor at 64 samples: a fifth of the variance at most."""
    (one, _, _), (other, _, _) = renders("independent", 64), renders("sobol", 64)
    gain, error = ratio_of_sums(one.var(axis=0, ddof=1), other.var(axis=0, ddof=1))
    assert gain - largest_z(1) * error > 5, f"{gain} ± {error}"
