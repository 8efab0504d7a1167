"""Phase functions as device records, and the tables of those that have one.  Pure NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene.flakes import area_bounds, flake_matrix
from clvol.scene.phase import lobe_kind, varied_lobes
from clvol.scene.records import GridVolume, Phase, PhaseTable
from clvol.scene.tabulated import density_points

if TYPE_CHECKING:
    from clvol.scene.boundaries import MediumEntry
    from clvol.scene.medium_facts import Matter

_Table = PhaseTable | tuple[float, ...] | GridVolume
ROUNDING = 1e-5
"""Share by which bounds of an area that is interpolated in single precision are wider."""


def phase_table(entries: tuple[MediumEntry, ...], matter: Matter) -> np.ndarray:
    """One PHASE record per lobe of each medium, in the order that `phase_first` counts in.

    Where some mixture's weight is a volume, each medium's lobes have as many records behind them that say how
    shares vary (cl/phase/varied.h).  Tables follow, each once, as records of three floats
    (cl/phase/tabphase.h, cl/phase/flakes.h).  Where some sggx differs from place to place, a record
    more stands before each (cl/phase/flakes_at.h).
    """
    varied = has_varied_lobes(entries)
    gridded = any(e.medium.flakes is not None for e in entries)
    rows: list[tuple[int, float, float]] = []
    tables: list[tuple[int, _Table]] = []
    for entry, number in zip(entries, matter.of_entry, strict=True):
        lobes = varied_lobes(entry.medium.phase)
        for lobe, share, _ in lobes:
            table = lobe.table if lobe.flakes is None else lobe.flakes
            tables += [] if table is None else [(len(rows), table)]
            kind = lobe_kind(entry.medium.phase, lobe)
            rows.append((layout.enum("PHASE", kind), lobe.g, share))
        volume = matter.roles[number].get("phase_weight", -1)
        rows += [(volume, slope, 0.0) for _, _, slope in lobes] if varied else []
    parts = [np.array(rows, layout.PHASE)]
    places: dict[_Table, int] = {}
    flakes = {id(e.medium.flakes): matter.roles[n] for e, n in zip(entries, matter.of_entry, strict=True)}
    end = len(rows)
    for row, table in tables:
        if table not in places:
            places[table] = end
            if isinstance(table, GridVolume):
                parts.append(_gridded(table, flakes[id(table)]["flakes"]))
            elif isinstance(table, tuple):
                parts += [_head(-1, 1.0, 1.0)] if gridded else []
                end += int(gridded)
                parts.append(_flakes(table))
            else:
                parts.append(_points(table))
            end += len(parts[-1])
        parts[0]["g"].view(np.int32)[row] = places[table] - row
    return np.concatenate(parts)


def has_varied_lobes(entries: tuple[MediumEntry, ...]) -> bool:
    """Whether lobes have records on how their shares vary behind them."""
    return any(e.medium.phase_weight is not None or e.medium.flakes is not None for e in entries)


def _head(volume: int, most: float, least: float) -> np.ndarray:
    """The record before the table of an sggx, or in its place: its volume, or -1, and bounds of its area."""
    return np.array([(volume, most, least)], layout.PHASE)


def _gridded(flakes: GridVolume, number: int) -> np.ndarray:
    """The record of an sggx in a volume: the most area, and the least as a share of it."""
    least, most = area_bounds(Phase("sggx", flakes=flakes))
    most *= 1 + ROUNDING
    return _head(number, most, least / most * (1 - ROUNDING) if most > 0 else 0.0)


def _flakes(values: tuple[float, ...]) -> np.ndarray:
    """The two triangles of an sggx (cl/phase/flakes.h), as records."""
    lower = np.linalg.cholesky(flake_matrix(values))
    inverse = np.linalg.inv(lower) * (np.pi * np.linalg.det(lower)) ** 0.25  # |L| is the root of |S|
    rows = np.concatenate([m[np.tril_indices(3)] for m in (lower, inverse)]).astype(np.float32)
    table: np.ndarray = rows.reshape(-1, 3).view(layout.PHASE)[:, 0]
    return table


def _points(table: PhaseTable) -> np.ndarray:
    """The number of the last point, then the points, as records."""
    columns = density_points(table)
    rows = np.zeros((len(columns[0]) + 1, 3), np.float32)
    rows[0, :1].view(np.int32)[0] = len(columns[0]) - 1
    rows[1:] = np.stack(columns, axis=1)
    points: np.ndarray = rows.view(layout.PHASE)[:, 0]
    return points
