"""The tests of agreement keep their false-alarm rate, for skewed samples too, and see what they promise.

Everything here is simulated; a rate is held against the binomial bound that it exceeds with probability 1e-4.
"""

import numpy as np
import pytest
from scipy import stats

from clvol.errors import OptionError
from clvol.lab import agreement as agreements
from clvol.lab.agreement import agreement

ALPHA, TRIES = 0.01, 300
MOST_ALARMS = stats.binom.isf(1e-4, TRIES, ALPHA)


def normal(rng, rounds):
    """Three channels of noise of their own."""
    return rng.normal(1.0, 0.3, (rounds, 16, 16, 3))


def skewed(rng, rounds):
    """Grey, lognormal: skewness 33."""
    return rng.lognormal(0.0, 1.5, (rounds, 16, 16, 1)).repeat(3, axis=-1)


def fireflies(rng, rounds):
    """Grey, with a rare sample 50 times as bright as the mean: half a sample of these in a round."""
    noise = rng.normal(1.0, 0.01, (rounds, 16, 16, 1))
    return noise + 50.0 * rng.poisson(0.002, noise.shape)


def alarms(draw, rounds, spp=None, bias=0.0, tries=TRIES):
    rng = np.random.default_rng(7)
    found = [
        agreement(draw(rng, rounds[0]) * (1 + bias), draw(rng, rounds[1]), 8, ALPHA, spp)
        for _ in range(tries)
    ]
    return sum(not one.agrees for one in found), found[0]


@pytest.mark.parametrize("draw", [normal, skewed, fireflies])
@pytest.mark.parametrize("rounds", [(2, 2), (6, 6), (4, 40)])
def test_false_alarms_keep_to_their_rate(draw, rounds):
    count, _ = alarms(draw, rounds, spp=(1, 1))
    assert count <= MOST_ALARMS


def test_the_simulation_sees_a_rate_that_is_too_high():
    """A short stack that believes in its own noise: why `spp` is given."""
    count, _ = alarms(fireflies, (4, 40), spp=None)
    assert count > 2 * MOST_ALARMS


CHANCE = 0.004
"""Of a hit in a pixel of a round."""


def by_chance(rng):
    """The same mean as `sampled`, in rare hits: about one in a tile of 4 rounds."""
    return (rng.random((4, 16, 16, 1)) < CHANCE) / CHANCE


def sampled(rng):
    return rng.normal(1.0, 0.01, (4, 16, 16, 1))


@pytest.mark.parametrize(("chance", "known"), [(1.0, 0.0), (0.1, 1 / CHANCE)])
def test_rare_samples_that_were_missed_are_no_alarm(chance, known, monkeypatch):
    """Tiles without a hit, where others have some; and pictures without any, if one is known to be large."""
    rng = np.random.default_rng(7)
    pairs = [(by_chance(rng) * (rng.random() < chance), sampled(rng)) for _ in range(TRIES)]
    if known:  # a mean of a few hits, which are the whole light: none in most pictures
        pairs = [(a, b * chance) for a, b in pairs]
    count = sum(not agreement(a, b, 8, ALPHA, largest=(known, 0.0)).agrees for a, b in pairs)
    assert count <= MOST_ALARMS
    monkeypatch.setattr(agreements, "_missed", lambda dark, bright: 0.0)  # the t-test alone
    assert sum(not agreement(a, b, 8, ALPHA).agrees for a, b in pairs) > 3 * MOST_ALARMS


def test_a_missing_light_of_small_samples_is_still_an_alarm():
    rng = np.random.default_rng(7)
    found = agreement(0.0 * sampled(rng), sampled(rng), largest=(1.0, 0.0))
    assert not found.agrees
    rare = agreement(by_chance(rng), sampled(rng))
    assert rare.smallest_bias > 9 / CHANCE / (4 * 256)  # ln(1 / level) hits


def test_normal_samples_use_up_most_of_the_rate():
    """Half of it at least: the tests are not doubtful beyond need (probability 1e-4 of failing at that)."""
    count, _ = alarms(normal, (6, 6))
    assert count >= stats.binom.ppf(1e-4, TRIES, ALPHA / 2)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("rounds", [(2, 2), (6, 6), (4, 12)])
def test_the_smallest_bias_is_seen_with_the_stated_probability(rounds, sign):
    _, clean = alarms(normal, rounds, tries=1)
    tries = 100
    seen, _ = alarms(normal, rounds, bias=sign * clean.smallest_bias, tries=tries)
    assert seen >= stats.binom.ppf(1e-4, tries, 0.95)
    half, _ = alarms(normal, rounds, bias=sign * clean.smallest_bias / 2, tries=tries)
    assert half < stats.binom.isf(1e-4, tries, 0.9)


def test_a_bias_of_one_tile_is_found_there():
    rng = np.random.default_rng(1)
    a, b = normal(rng, 6), normal(rng, 6)
    a[:, 8:16, 0:8, 2] *= 1.2
    found = agreement(a, b)
    assert not found.agrees and found.worst_tile == (0, 8) and found.tile_p < 1e-6
    assert "differ" in found.explanation


def test_a_bias_of_one_channel_is_found_in_the_mean():
    rng = np.random.default_rng(2)
    a, b = normal(rng, 6), normal(rng, 6)
    a[..., 0] *= 1.1
    found = agreement(a, b)
    assert found.mean_p < 1e-4 and "image means differ" in found.explanation


def test_certain_pixels_agree_but_for_rounding():
    a, b = np.full((2, 9, 5, 3), 0.7), np.full((3, 9, 5, 3), 0.7)
    assert agreement(a, b).p == 1.0
    assert agreement(a * (1 + 1e-6), b).agrees
    assert not agreement(a * 1.001, b).agrees
    black = agreement(0 * a, 0 * b)
    assert black.agrees and black.smallest_bias == np.inf and "black" in black.explanation


def test_values_that_are_not_finite_never_agree():
    a = np.ones((2, 4, 4, 3))
    a[0, 0, 0, 0] = np.nan
    found = agreement(a, a)
    assert not found.agrees and "not finite" in found.explanation


@pytest.mark.parametrize(
    ("a", "b", "options"),
    [
        ((1, 4, 4, 3), (4, 4, 4, 3), {}),
        ((2, 4, 4, 3), (2, 4, 5, 3), {}),
        ((2, 4, 4), (2, 4, 4), {}),
        ((2, 4, 4, 3), (2, 4, 4, 3), {"alpha": 0.0}),
        ((2, 4, 4, 3), (2, 4, 4, 3), {"tile": 0}),
    ],
)
def test_what_cannot_be_compared_is_refused(a, b, options):
    with pytest.raises(OptionError):
        agreement(np.ones(a), np.ones(b), **options)
