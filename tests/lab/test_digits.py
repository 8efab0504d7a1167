"""Figures are printed with as many digits as their errors deserve."""

from __future__ import annotations

import math

import numpy as np
import pytest

from clvol.lab.digits import up_to_error, with_ends, with_error
from clvol.lab.statistics import Interval


@pytest.mark.parametrize(
    ("mean", "error", "text"),
    [
        (0.432123, 0.00083, "0.4321 ± 0.0008"),
        (0.432123, 0.0012, "0.4321 ± 0.0012"),
        (0.5, 0.0996, "0.50 ± 0.10"),
        (0.5, 0.96, "0.5 ± 1.0"),
        (12345, 378, "12300 ± 400"),
        (4.3123e-5, 2e-6, "(4.3 ± 0.2)e-05"),
        (1e7, 2e5, "(1.00 ± 0.02)e+07"),
        (-0.3, 0.02, "-0.30 ± 0.02"),
        (0.0, 0.002, "0.000 ± 0.002"),
        (3, 30, "0 ± 30"),
        (0.1353352832, 0.0, "0.1353353 ± 0"),
        (1e30, 1e20, "(1 ± 1e-10)e+30"),
        (1e-300, 1e-301, "0 ± 0"),
        (3.3, math.nan, "3.3 ± nan"),
    ],
)
def test_a_mean_ends_where_its_error_does(mean: float, error: float, text: str) -> None:
    assert with_error(mean, error) == text


def test_what_is_printed_is_within_half_an_error_and_has_no_digit_to_spare() -> None:
    random = np.random.default_rng(1)
    for _ in range(2000):
        value = random.choice([-1, 1]) * 10 ** random.uniform(-9, 9)
        error = abs(value) * 10 ** random.uniform(-6, -0.5)
        text = up_to_error(value, error)
        assert abs(float(text) - value) <= error / 2
        digits = text.lstrip("-").split("e")[0]
        place = digits[::-1].find(".")  # -1 for whole numbers
        if place > 0:
            power = int(text.split("e")[1]) if "e" in text else 0
            assert 10.0 ** (power - place) > error / 100  # the last digit counts


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        ((0.476, 0.376, 0.604), "0.48 (0.38 to 0.60)"),
        ((0.488, 0.479, 0.497), "0.488 (0.479 to 0.497)"),
        ((170.3, 150.2, 190), "170 (150 to 190)"),
        ((2.3, 0.1, 50), "2.3 (0.1 to 50)"),
        ((0.5, 0.00002, 23506.7), "0.5 (0.0 to 23500)"),
        ((2, 1, math.inf), "2.0 (1.0 to inf)"),
        ((3e-5, 2e-5, 4e-5), "3.0e-05 (2.0e-05 to 4.0e-05)"),
        ((1, 1, 1), "1 (1 to 1)"),
        ((math.nan, 0, 0), "unknown"),
    ],
)
def test_an_interval_has_the_digits_that_its_width_leaves(interval: tuple, text: str) -> None:
    assert with_ends(Interval(*interval)) == text
