"""Ranges of samples follow from the picture alone, and their sums are added in one order, whoever adds."""

import math

import numpy as np
import pytest

from clvol.cluster.ranges import (
    LEAST_PATHS,
    LEAST_RANGES,
    MOST_RANGES,
    RANGE_PATHS,
    Tree,
    range_length,
    sample_ranges,
)
from clvol.cluster.survey import Need
from clvol.picture.estimate import Moments
from clvol.picture.parts import FAN_IN, Part, added, sum_of
from clvol.picture.result import Result
from clvol.rendering.session import MAX_SAMPLES


def part(first, values):
    sums = Moments(np.asarray(values, float).reshape(1, 1, -1), np.ones((1, 1, 3)), 1)
    return Part.of(Result.from_estimate(sums, (first, 1), {}, {}, {"seed": 1}))


@pytest.mark.parametrize("count", [1, 7, LEAST_RANGES, 1000, 10**6, MAX_SAMPLES])
@pytest.mark.parametrize("pixels", [1, 640 * 480, 10**8])
def test_ranges_cover_the_samples_and_are_neither_few_nor_many(count, pixels):
    length = range_length(count, pixels)
    ranges = -(-count // length)
    if count < MAX_SAMPLES:
        found = list(sample_ranges(5, count, pixels))
        assert [first for first, _ in found] == [5 + n * length for n in range(ranges)]
        assert sum(size for _, size in found) == count
        assert min(count, LEAST_RANGES) // 2 <= ranges <= MOST_RANGES
    assert length == 1 or length * pixels <= max(RANGE_PATHS, pixels * -(-count // MOST_RANGES))


def test_a_range_is_worth_what_it_costs(monkeypatch):
    monkeypatch.setattr("clvol.cluster.ranges.LEAST_PATHS", LEAST_PATHS)
    for pixels, count in ((128 * 128, 1024), (100, 10**5), (1920 * 1080, 64), (10**8, 3)):
        length = range_length(count, pixels)
        assert LEAST_PATHS <= length * pixels < LEAST_PATHS + pixels or length == 1
    assert range_length(10, 100) == 10, "a small picture is one"


@pytest.mark.parametrize("count", [1, 2, FAN_IN, FAN_IN + 1, 3 * FAN_IN**2 + 5 * FAN_IN + 3])
def test_sums_have_the_bits_of_merge_whatever_order_they_come_in(count):
    rng = np.random.default_rng(count)
    parts = [part(n, rng.lognormal(0, 9, 3)) for n in range(count)]
    expected = added(parts).estimate.sum_
    for _ in range(3):
        tree = Tree(sum_of)
        for n in rng.permutation(count):
            tree.put(n, parts[n])
        assert tree.root().estimate.sum_.tobytes() == expected.tobytes()
        assert sum_of(tree.tops()).samples == count
    if count > FAN_IN**2:
        in_a_row = sum_of(parts).estimate.sum_
        assert in_a_row.tobytes() != expected.tobytes(), "the numbers show the order"


def test_what_is_lost_is_known_by_the_ranges_it_was_of():
    tree = Tree(sum)
    for n in range(2 * FAN_IN + 3):
        tree.put(n, 1)
    assert tree.tops() == [FAN_IN, FAN_IN, 1, 1, 1]
    gone = iter([False, True, False, True, False])
    assert tree.lost(lambda _: next(gone)) == [
        range(2 * FAN_IN + 1, 2 * FAN_IN + 2),
        range(FAN_IN, 2 * FAN_IN),
    ]
    assert tree.tops() == [FAN_IN, 1, 1]
    for n in (*range(FAN_IN, 2 * FAN_IN), 2 * FAN_IN + 1):
        tree.put(n, 1)
    assert tree.root() == 2 * FAN_IN + 3


def needs(target, most, noise_of_one, low_discrepancy):
    """What surveys ask for, one after the other, until one is enough."""
    need, asked = Need.of(target, most, 0, math.nan, low_discrepancy), []
    while need.survey:
        asked.append(need.survey)
        noise = noise_of_one / math.sqrt(need.survey)
        need = Need.of(target, most, need.survey, noise, low_discrepancy)
    return need.picture, asked


def test_surveys_grow_until_they_have_an_eighth_of_what_the_picture_needs():
    assert needs(0.01, None, 1.0, False) == (10_000, [16, 64, 256, 1024, 2048])
    assert needs(0.01, None, 1.0, True) == (16_384, [16, 64, 256, 1024, 2048])
    assert needs(0.01, 500, 1.0, False) == (500, [16, 64])
    assert needs(0.01, None, 1e-4, False) == (16, [16])
    assert needs(0.01, None, math.nan, False) == (16, [16, 64, 256])
    assert needs(0.01, 8, math.nan, False) == (8, [16])
