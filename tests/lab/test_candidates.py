"""What a pilot makes of its candidates' rounds: made-up ones, whose variances and seconds are planted."""

import numpy as np
import pytest

from clvol.lab.candidates import Candidate, error, halve, precomputation, relative_efficiency


def planted(deviation, seconds, rounds=4, seed=1, extra=0.0):
    """A candidate with noise of a known deviation."""
    rng = np.random.default_rng(seed)
    images = list(rng.normal(1.0, deviation, (rounds, 32, 32, 3)))
    return Candidate(f"{deviation} {seconds}", None, images, [seconds] * rounds, extra)


def test_relative_efficiency_is_that_of_variance_times_seconds():
    base, quieter, slower = planted(0.2, 1.0, seed=1), planted(0.1, 1.0, seed=2), planted(0.2, 3.0, seed=3)
    for one, expected in ((quieter, 4.0), (slower, 1 / 3)):
        found = relative_efficiency(one, base)
        assert found.low < expected < found.high and found.high / found.low < 1.4
    assert relative_efficiency(base, base).value == 1.0
    assert relative_efficiency(planted(0.0, 1.0), planted(0.0, 1.0)).value == 1.0  # black pictures


def test_halving_keeps_the_better_half_and_counts_precomputation():
    a, b, c = planted(0.2, 1.0, seed=1), planted(0.1, 1.0, seed=2), planted(0.2, 0.1, seed=3)
    assert halve([a, b, c], a, [a, b, c]) == [c, b] and halve([a, b], a, [a, b]) == [b]
    c.extra = 1.0
    assert halve([a, b, c], a, [a, b, c]) == [b, a]
    b.largest_weight = 1e4  # noisier than it looks
    assert halve([a, b, c], a, [a, b, c]) == [a, c]
    a.largest_weight = c.largest_weight = 1e4
    assert halve([a, b, c], a, [a, b, c]) == [b, a]


def lamp(chance, rounds=4, seed=5, base=0.0, noise=0.0, mean=1.0, seconds=1.0):
    """A candidate that finds a lamp by chance: hits in so many pixels of a round, of the given mean.

    Beside it stands a base with noise.
    """
    rng = np.random.default_rng(seed)
    hits = (rng.random((rounds, 32, 32, 1)) < chance) * (mean / chance) * np.ones(3)
    images = list(hits + base + rng.normal(0, noise, hits.shape))
    return Candidate(f"{chance}", None, images, [seconds] * rounds)


@pytest.mark.parametrize(("chance", "hits"), [(1.0, 4096), (0.1, 1), (1e-3, 1)])
@pytest.mark.parametrize("base", [0.0, 0.5])
def test_who_missed_a_rare_light_does_not_win(chance, hits, base):
    """Its rounds have no scatter, and take half the time; it loses both to auto's choice and as auto's."""
    sees, misses = lamp(chance, base=base, noise=1e-9), lamp(1e-9, base=base, seconds=0.5)
    assert np.count_nonzero(np.array(sees.images)[..., 0] > base + 0.1) >= hits
    for auto, other in ((sees, misses), (misses, sees)):
        assert halve([auto, other], auto, [auto, other]) == [sees]
        found = relative_efficiency(other, auto)
        assert np.isfinite([found.value, found.low, found.high]).all() and "inf" not in str(found)
        assert (found.value > 1) is (other is sees)


def test_who_missed_a_light_does_not_win_by_noise_of_its_own():
    sees, misses = lamp(0.2, base=1.0, noise=0.1), lamp(1e-9, base=1.0, noise=0.1, seconds=0.1)
    assert halve([misses, sees], misses, [misses, sees]) == [sees]
    assert error(misses, [sees]).mean() > 100 * misses.variance.mean()


def test_sound_candidates_have_no_error_but_their_variance():
    """Of other noise by as much as one likes, skewed too; one that is exact stays the best."""
    for n in range(10):
        sound = [planted(0.01, 1.0, seed=n), planted(0.3, 1.0, seed=n + 20), lamp(0.02, seed=n + 40)]
        for one in sound[:2]:
            assert error(one, sound).mean() < 1.01 * one.variance.mean()
        assert error(sound[2], sound).mean() < 1.5 / 0.02  # its own is 49; tiles without a hit lack some
    exact, noisy = planted(0.0, 2.0), planted(0.3, 1.0)
    assert halve([exact, noisy], noisy, [exact, noisy]) == [exact]
    assert 1 < relative_efficiency(exact, noisy).value < np.inf


def test_precomputation_counts_in_proportion_to_the_render():
    assert precomputation(2.0, 0.1, rounds=100.0, limit=None) == pytest.approx(0.02)
    assert precomputation(2.0, 0.1, rounds=None, limit=4.0) == pytest.approx(0.1)  # half the time is left
    late = precomputation(5.0, 0.1, rounds=None, limit=4.0)
    assert np.isfinite(late) and late > 90  # no time is left
