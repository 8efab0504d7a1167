"""The numbers that decisions read, and those of their neighbours.

Neighbours in pixel, sample, bounce, block, segment and seed tell nothing of each other: χ² over pairs of six
bits, high and low ones, and over the bits in which neighbours differ; correlations of the numbers.
False-alarm rate 1e-4 for each neighbourhood, at fixed seeds.  tools/random_numbers.py writes the same
numbers for `dieharder`.
"""

import numpy as np
import pytest
from probe import Probe, medium_of, scene_of
from sampling import uniform_p_value
from scipy import stats
from stat_tests import FALSE_ALARM, chi2_p_value, largest_z, sidak

COUNT = 1 << 16
BODY = """
    __global uint *g = in0 + 5 * i;
    SampleKey key;
    key.pixel = g[0], key.sample = g[1], key.bounce = g[2];
    vstore4(decision_block(scene, key, g[3], g[4]), i, out0);"""
AXES = {"pixel": 0, "sample": 1, "bounce": 2, "block": 3, "segment": 4}
FAR = {"pixel": 1 << 22, "sample": 2**32 - 9, "bounce": 99, "block": 2, "segment": 31}
"""Where else neighbours are tried: in large pictures, at the last samples, deep down."""


@pytest.fixture(scope="module")
def probe(device):
    return Probe(device, scene_of(medium_of(1.0, albedo=0.5)), sampler="independent")


def numbers(probe, seed, **at):
    """Blocks (COUNT, 4) of every second pixel and sample from a place on."""
    place = {"pixel": 0, "sample": 0, "bounce": 1, "block": 1, "segment": 0} | at
    pixel, sample = np.divmod(np.arange(COUNT, dtype=np.int64), 64)
    keys = np.stack([np.broadcast_to(place[name], COUNT) for name in AXES], axis=-1).astype(np.int64)
    keys[:, 0] += 2 * pixel
    keys[:, 1] += 2 * sample
    out = np.zeros((COUNT, 4), np.uint32)
    probe.upload(seed)
    probe.run([], BODY, [out], [(keys % 2**32).astype(np.uint32)])
    return out


def p_values(a, b):
    """Of two arrays of words that should be independent and uniform."""
    values = []
    for shift in (26, 13, 0):
        left, right = ((words >> shift & 63).astype(int).ravel() for words in (a, b))
        values.append(uniform_p_value(64 * left + right, 4096))
    differing = np.bitwise_count(a ^ b).sum(axis=1)
    bits = 32 * a.shape[1]
    expected = stats.binom.pmf(np.arange(bits + 1), bits, 0.5) * len(a)
    values.append(chi2_p_value(np.bincount(differing, minlength=bits + 1), expected))
    share = max(abs(((a ^ b) >> bit & 1).mean() - 0.5) for bit in range(32))
    z = 2 * share * np.sqrt(a.size)
    values.append(1 - (1 - 2 * stats.norm.sf(z)) ** 32)
    return values


def assert_independent(a, b):
    values = p_values(a, b)
    assert min(values) > sidak(FALSE_ALARM, len(values)), values
    correlation = np.corrcoef(a.ravel() / 2**32, b.ravel() / 2**32)[0, 1]
    assert abs(correlation) * np.sqrt(a.size) < largest_z(1)


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("axis", AXES)
def test_neighbours_are_independent(probe, axis, far):
    place = {axis: FAR[axis] if far else 1}
    a = numbers(probe, 5, **place)
    assert_independent(a, numbers(probe, 5, **{axis: place[axis] + 1}))


@pytest.mark.parametrize("seeds", [(0, 1), (7, 7 + 2**32), (2**63, 2**63 + 1)])
def test_neighbouring_seeds_are_independent(probe, seeds):
    a, b = (numbers(probe, seed) for seed in seeds)
    assert_independent(a, b)


def test_words_of_a_block_are_independent(probe):
    a = numbers(probe, 3)
    for one, other in (([0, 2], [1, 3]), ([0, 1], [2, 3]), ([0, 1], [3, 2])):
        assert_independent(a[:, one], a[:, other])


def test_numbers_that_share_a_bit_are_noticed(probe):
    """Power: one bit of 32 that agrees in 51 of 100 places, and a number half of which is the other."""
    a, b = numbers(probe, 5), numbers(probe, 6)
    same = np.random.default_rng(1).random(a.shape) < 0.02
    few = np.where(same, (b & ~np.uint32(1)) | (a & np.uint32(1)), b)
    with pytest.raises(AssertionError):
        assert_independent(a, few)
    with pytest.raises(AssertionError):
        assert_independent(a, np.where(np.arange(4) < 1, a, b))
