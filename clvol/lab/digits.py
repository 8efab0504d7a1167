"""Numbers as text, with as many digits as their errors deserve."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clvol.lab.statistics import Interval

MOST_DIGITS = 7
"""Significant digits of float32, which nothing here has more of."""
_SMALL, _LARGE = 1e-3, 1e6
"""Beyond, a power of ten spares counting noughts."""
_FAR = 10.0
"""An end that is more than so many times as large as the value is told to a twentieth of itself."""
_NOTHING = 1e-290
"""Anything smaller is shown as 0."""


def with_error(mean: float, error: float) -> str:
    """An estimate and its standard error: "0.4321 ± 0.0008", "12300 ± 400", "(4.3 ± 0.2)e-05".

    The error has one digit, or two where the first is a 1; the mean ends at the same place.
    """
    scale, power = _scale(max(abs(mean), error))
    mean, error = mean * scale, error * scale
    own = _cut(error, error) if error > _least(mean) else f"{error:.1g}"
    return f"({_cut(mean, error)} ± {own}){power}" if power else f"{_cut(mean, error)} ± {own}"


def up_to_error(value: float, error: float) -> str:
    """A number with the digits that its error leaves: "0.43" where it is 0.4321 ± 0.03."""
    scale, power = _scale(max(abs(value), error))
    return f"{_cut(value * scale, error * scale)}{power}"


def with_ends(interval: Interval) -> str:
    """An estimate and the ends of its 95 % interval: "0.48 (0.38 to 0.60)"; "unknown" where it is.

    All three have the digits that the standard error leaves, by the end that is nearer.
    """
    if not math.isfinite(interval.value):
        return "unknown"
    scale, power = _scale(abs(interval.value))
    ends = interval.value, interval.low, interval.high
    error = min(interval.value - interval.low, interval.high - interval.value) / 2
    errors = [max(error, abs(end) / 20) if abs(end) > _FAR * abs(interval.value) else error for end in ends]
    value, low, high = (
        f"{_cut(end * scale, own * scale)}{power}" for end, own in zip(ends, errors, strict=True)
    )
    return f"{value} ({low} to {high})"


def two_digits(value: float) -> str:
    """A number with two digits, the last a nought too: "0.20"."""
    return f"{value:#.2g}".removesuffix(".")


def _scale(size: float) -> tuple[float, str]:
    """What to multiply numbers of this size with, and the power of ten that makes up for it, "" for none."""
    if not math.isfinite(size) or _SMALL <= size < _LARGE:
        return 1.0, ""
    if size < _NOTHING:
        return 0.0, ""
    power = math.floor(math.log10(size))
    return 10.0**-power, f"e{power:+03d}"


def _least(value: float) -> float:
    """An error below which a number has all the digits that it can have."""
    return abs(value) * 10.0**-MOST_DIGITS


def _cut(value: float, error: float) -> str:
    """A number up to the first digit of its error, or to the second where the first is a 1."""
    if not (math.isfinite(value) and math.isfinite(error)):
        return f"{value:.3g}"
    if error <= _least(value):
        return f"{value:.{MOST_DIGITS}g}"
    place = math.floor(math.log10(error))
    first = error / 10.0**place
    place -= first < 1.95
    return f"{round(value, -place):.0f}" if place >= 0 else f"{value:.{-place}f}"
