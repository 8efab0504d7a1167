"""Transfer functions in NumPy: values, extrema over ranges, and bounds of classified fields."""

from __future__ import annotations

import numpy as np
import pytest

from clvol.accel.bounds import with_slack
from clvol.volumes.bricks import BOUND_CELLS, build_bricks
from clvol.volumes.grid import DenseGrid
from clvol.volumes.transfer import MOST_POINTS, text_of_points, transfer_of_points

STEPS = [(-2, 1), (0, 3), (0, 0), (1, 0), (1, 2), (4, 0.5)]


def test_it_is_linear_between_points_and_constant_beyond() -> None:
    smooth = [(-1, 0), (0.5, 2), (3, 1)]
    at = np.linspace(-3, 5, 1001)
    made = transfer_of_points(smooth)(at)
    assert np.allclose(made, np.interp(at, *np.array(smooth).T)[:, None])
    colours = transfer_of_points([(0, (1, 0, 0.5)), (2, (0, 1, 0.5))])
    assert np.allclose(colours(np.array([1.0])), [[0.5, 0.5, 0.5]])
    assert transfer_of_points([(7, 3)])(np.array([-1.0, 9])).tolist() == [[3] * 3] * 2


def test_a_step_has_its_second_number() -> None:
    made = transfer_of_points(STEPS)(np.array([-3, -1e-9, 0, 0.5, 1, 4, 9]))[:, 0]
    assert np.allclose(made, [1, 3, 0, 0, 2, 0.5, 0.5])


def test_extrema_are_those_of_all_values_in_a_range() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        values = np.sort(rng.integers(-9, 9, rng.integers(1, 12))).astype(float)
        transfer = transfer_of_points([(v, c) for v, c in zip(values, rng.random(len(values)), strict=True)])
        low = rng.uniform(-11, 11, 20)
        high = low + rng.choice([0, 0.3, 4, 30], 20)
        least, most = transfer.extrema(low, high)
        for n in range(20):
            inside = values[(values >= low[n]) & (values <= high[n])]
            at = np.concatenate([np.linspace(low[n], high[n], 400), inside, np.nextafter(inside, -99)])
            made = transfer(at[(at >= low[n]) & (at <= high[n])])[:, 0]
            assert least[n] <= made.min() + 1e-12 and most[n] >= made.max() - 1e-12
            assert made.min() - least[n] < 0.2 and most[n] - made.max() < 0.2


@pytest.mark.parametrize("points", [STEPS, [(0.1, 0), (0.2, 9), (0.3, 0)]], ids=["steps", "window"])
def test_bounds_hold_for_every_value_between_samples(points: list[tuple[float, float]]) -> None:
    """Also where every sample is classified as nothing, and something lies between them."""
    rng = np.random.default_rng(9)
    values = rng.choice([-2.0, 0.0, 1.0, 3.0], (17, 18, 20)).astype(np.float32)
    values[:9] = -2
    transfer = transfer_of_points(points)
    bricks = build_bricks(DenseGrid(values[..., None], np.array([[0.0] * 3, [1] * 3])))
    bounds = with_slack(bricks.minimum, bricks.maximum, BOUND_CELLS, bricks.means(transfer), transfer)
    place = rng.uniform(0, np.array(values.shape) - 1.001, (60_000, 3))
    base = place.astype(int)
    between = np.zeros(len(place))
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(corner, place - base, 1 - place + base).prod(axis=1)
        between += weight * values[tuple((base + corner).T)]
    made = transfer(between.astype(np.float32))[:, 0]
    cell = tuple((base // BOUND_CELLS).T)
    assert (made <= bounds.maximum[cell][:, 0]).all() and (made >= bounds.minimum[cell][:, 0]).all()
    assert bounds.mean is not None and (bounds.mean <= bounds.maximum).all()


def test_space_that_is_classified_as_nothing_is_empty() -> None:
    values = np.full((33, 33, 33, 1), -1000, np.float32)
    values[20:24, 20:24, 20:24] = 300
    bricks = build_bricks(DenseGrid(values, np.array([[0.0] * 3, [1] * 3])))
    bounds = with_slack(
        bricks.minimum, bricks.maximum, BOUND_CELLS, transfer=transfer_of_points([(-1000, 0), (300, 2)])
    )
    assert np.count_nonzero(bounds.maximum) <= 27 < bounds.maximum.size


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([], "1 to"),
        ([(0, 1)] * (MOST_POINTS + 1), "1 to"),
        ([(0, -1)], "at least 0"),
        ([(0, np.nan)], "finite"),
        ([(np.inf, 1)], "finite"),
        ([(0, 1e38), (1, 0)], "finite"),
        ([(1, 0), (0, 1)], "must not fall: 1 comes before 0"),
        ([(0, (1, 2))], "one or three"),
        ([1, 2], "pairs"),
        (7, "pairs"),
        ({"a": 1}, "pairs"),
        ("0, 1", "value: number"),
        ("0: x", "value: number"),
        ("", "value: number"),
    ],
)
def test_what_is_no_function_is_said(points: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        transfer_of_points(points)


def test_text_says_the_same() -> None:
    for points in (STEPS, [(-1, (0.1, 0.2, 0.3)), (1e-3, (1, 1, 1))]):
        transfer = transfer_of_points(points)
        again = transfer_of_points(text_of_points(transfer))
        assert np.array_equal(again.values, transfer.values)
        assert np.array_equal(again.colours, transfer.colours)
