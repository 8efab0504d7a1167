"""Transfer functions: what is made of a sample's value, piecewise linear between points.

A field is classified *after* it is interpolated: the function is applied to the value at a point, not to the
samples around it.  So thin features of the function stay sharp, and bounds of the result over a cell are
those of the function over the range of the cell's values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

MOST_POINTS = 4096
"""Points of a transfer function: the device's search among them takes twelve steps."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """A function of a number, linear between points, and constant before the first and beyond the last.

    values : float32 (n,), 2 points at least, that do not fall.  Two that are equal make a step, whose place
        has the second one's colour.
    colours : float32 (n, 3), finite and at least 0; a grey one repeats its number.
    """

    values: np.ndarray
    colours: np.ndarray

    @property
    def is_grey(self) -> bool:
        """Whether the channels are the same everywhere."""
        return bool((self.colours == self.colours[:, :1]).all())

    def points(self) -> list[tuple[float, float | tuple[float, ...]]]:
        """Pairs of a value and a number, or of a value and a colour where some are coloured."""
        grey = self.is_grey
        rows = zip(self.values, self.colours, strict=True)
        return [(_short(v), _short(c[0]) if grey else tuple(map(_short, c))) for v, c in rows]

    @property
    def largest(self) -> float:
        """The largest number that it takes in any channel."""
        return float(self.colours.max())

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Colours of values (...), float64 (..., 3)."""
        at = np.asarray(values, np.float64)
        low = np.clip(np.searchsorted(self.values, at, side="right") - 1, 0, len(self.values) - 2)
        start, end = (self.values[n].astype(np.float64) for n in (low, low + 1))
        step = np.array(at >= end, np.float64)
        share = np.divide(at - start, end - start, out=step, where=end > start)
        share = np.clip(share, 0, 1)[..., None]
        colours = self.colours.astype(np.float64)
        between: np.ndarray = colours[low] * (1 - share) + colours[low + 1] * share
        return between

    def extrema(self, lowest: np.ndarray, highest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest of the first channel over ranges of values, float64 (...) each.

        What a range's ends have, and the points within it.
        """
        ends = self(lowest)[..., 0], self(highest)[..., 0]
        low, high = np.minimum(*ends), np.maximum(*ends)
        first = np.searchsorted(self.values, lowest, side="left")
        count = np.searchsorted(self.values, highest, side="right") - first
        level = np.floor(np.log2(np.maximum(count, 1))).astype(int)
        last = np.maximum(first + count - (1 << level), 0)
        inside = count > 0
        first = np.minimum(first, len(self.values) - 1)
        for table, combine, result in zip(self._ranges, (np.minimum, np.maximum), (low, high), strict=True):
            found = combine(table[level, first], table[level, last])
            result[inside] = combine(result, found)[inside]
        return low, high

    @cached_property
    def _ranges(self) -> tuple[np.ndarray, np.ndarray]:
        """Extrema of the first channel over 2^level points from each on, (levels, n) each."""
        tables = []
        for combine in (np.minimum, np.maximum):
            rows = [self.colours[:, 0].astype(np.float64)]
            while 1 << len(rows) <= len(self.values):
                half = 1 << (len(rows) - 1)
                shifted = np.append(rows[-1][half:], np.repeat(rows[-1][-1], half))
                rows.append(combine(rows[-1], shifted))
            tables.append(np.stack(rows))
        return tables[0], tables[1]


def _short(number: np.float32) -> float:
    """The shortest number that is the same float32: 0.2 rather than 0.200000003."""
    return float(str(number))


def made_of(values: np.ndarray, transfer: Transfer | None) -> np.ndarray:
    """The first channel of what a transfer function makes of values, float32; the values without one."""
    return values if transfer is None else transfer(values)[..., 0].astype(np.float32)


@dataclass(frozen=True, eq=False)
class Transfers:
    """What a medium makes of the values of one field, by what of it that is; None: not made of values."""

    sigma_t: Transfer
    albedo: Transfer | None = None
    emission: Transfer | None = None


def transfer_of_points(points: object) -> Transfer:
    """A transfer function from pairs of a value and a number, or of a value and three.

    Raises ValueError, which says what is wrong, for anything else.
    """
    if isinstance(points, str):
        points = _points_of_text(points)
    try:
        pairs = [(float(value), np.asarray(colour, np.float64).reshape(-1)) for value, colour in points]  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        raise ValueError(
            "expected pairs of a value and a number or colour, such as [(0, 0), (100, 1)]"
        ) from None
    if not 1 <= len(pairs) <= MOST_POINTS:
        raise ValueError(f"expected 1 to {MOST_POINTS} points, got {len(pairs)}")
    if any(colour.size not in (1, 3) for _, colour in pairs):
        raise ValueError("expected one or three numbers beside each value")
    values = np.array([value for value, _ in pairs]).astype(np.float32)
    colours = np.stack([np.broadcast_to(colour, 3) for _, colour in pairs]).astype(np.float32)
    if not (np.abs(values) <= _LARGEST).all() or not (np.abs(colours) <= _LARGEST).all():
        raise ValueError(f"values and numbers must be finite, and at most {_LARGEST:g}")
    if (np.diff(values) < 0).any():
        at = int(np.flatnonzero(np.diff(values) < 0)[0])
        raise ValueError(f"values must not fall: {values[at]:g} comes before {values[at + 1]:g}")
    if (colours < 0).any():
        raise ValueError(f"numbers must be at least 0, got {colours.min():g}")
    if len(values) == 1:
        values, colours = np.repeat(values, 2), np.repeat(colours, 2, axis=0)
    return Transfer(values, colours)


_LARGEST = 1e30
"""Differences of two such floats, and what they are multiplied with, are finite."""


def _points_of_text(text: str) -> list[tuple[float, list[float]]]:
    """Points as scene files have them: ``-500: 0, 300: 0.5 0.4 0.3``."""
    points = []
    for part in text.split(","):
        value, colon, numbers = part.partition(":")
        try:
            if not colon:
                raise ValueError
            points.append((float(value), [float(number) for number in numbers.split()]))
        except ValueError:
            what = f"expected value: number, value: number, …, got '{part.strip()[:40]}'"
            raise ValueError(what) from None
    return points


def text_of_points(transfer: Transfer) -> str:
    """The same the other way round: what a scene file has for a transfer function."""
    words = (
        (value, colour if isinstance(colour, tuple) else (colour,)) for value, colour in transfer.points()
    )
    return ", ".join(f"{v:.9g}: {' '.join(f'{number:.9g}' for number in colour)}" for v, colour in words)
