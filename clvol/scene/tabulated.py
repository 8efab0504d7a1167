"""Phase functions by table: how they are read, checked, and turned into points of a density."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import shortened
from clvol.scene.records import Phase, PhaseTable

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

MAX_VALUES = 1 << 16
"""Most values of a table."""

SHARPEST = 1e12
"""Largest density per steradian; single precision resolves no sharper peak."""


def tabphase(reader: Reader) -> Phase:
    """The `tabphase` plugin: `values` over the cosine, from -1 (back) to 1 (straight on).

    `angles` (ours): what they are values of, in degrees from 0 (straight on) to 180.
    """
    if not reader.has("values"):
        reader.fail("a tabphase needs values", hint="of the cosines -1 to 1, as '0.5, 1, 2'")
    values = numbers(reader, "values")
    angles = numbers(reader, "angles") if reader.has("angles") else ()
    table = PhaseTable(values, angles)
    if fault := table_fault(table):
        reader.fail(f"{fault[1]} of a tabphase", fault[0])
    return Phase("tabphase", table=table)


def numbers(reader: Reader, name: str) -> tuple[float, ...]:
    """Numbers between commas or blanks, or an array of one axis."""
    if not isinstance(reader.raw(name), str):
        array = np.ma.filled(reader.array(name).astype(np.float64), np.nan)
        if array.ndim != 1:
            reader.fail(f"'{name}' of a {reader.type} must be numbers in a row", name)
        return tuple(array.tolist())
    words = reader.string(name, "").replace(",", " ").split()
    numbers = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            reader.fail(f"'{name}' of a {reader.type} has '{shortened(word, 40)}', which is no number", name)
    return tuple(numbers)


def table_fault(table: PhaseTable) -> tuple[str, str] | None:
    """The parameter that is wrong and what is, to be followed by whose; None for a table that is right."""
    values, angles = np.array(table.values), np.array(table.angles)
    if not 2 <= values.size <= MAX_VALUES:
        return "values", f"there must be 2 to {MAX_VALUES} values, not {values.size},"
    if not np.isfinite(values).all() or (values < 0).any() or not (values > 0).any():
        return "values", "values must be finite and >= 0, and not all 0, those"
    if angles.size:
        if angles.size != values.size:
            return "angles", f"there must be as many angles as values, {values.size}, not {angles.size},"
        if not (angles[0] == 0 and angles[-1] == 180 and (np.diff(angles) > 0).all()):
            return "angles", "angles must increase from 0 to 180, those"
    with np.errstate(all="ignore"):
        density = density_points(table)[1]
    if not np.isfinite(density).all() or density.max() > SHARPEST:
        return "values", "there is a peak that is too narrow for single precision in the values"
    return None


def density_points(table: PhaseTable) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """1 - cos, value per solid angle and share of directions up to there, float32 each.

    From straight on (0) to back (2), of integral one.  Points that fall together in single precision are one.
    """
    values = np.array(table.values)
    if table.angles:
        x = 2 * np.sin(np.radians(np.array(table.angles)) / 2) ** 2
    else:
        x, values = np.linspace(0, 2, values.size), values[::-1]
    x = x.astype(np.float32)
    x[-1] = 2
    kept = np.append(np.diff(x) > 0, True)
    x, values = x[kept], values[kept] / values[kept].max()
    x[0] = 0
    widths = np.diff(x.astype(np.float64))
    parts = np.pi * (values[1:] + values[:-1]) * widths
    whole = parts.sum()
    shares = np.concatenate([[0.0], np.cumsum(parts / whole)])
    shares[-1] = 1
    return x, (values / whole).astype(np.float32), shares.astype(np.float32)


def mean_cosine(table: PhaseTable) -> float:
    """Mean cosine of the angle by which light is turned."""
    x, density, _ = (column.astype(np.float64) for column in density_points(table))
    a, b = 1 - x[:-1], 1 - x[1:]
    p, q = density[:-1], density[1:]
    return float((np.pi / 3 * (a - b) * (2 * a * p + a * q + b * p + 2 * b * q)).sum())
