"""Phase functions as device records, and the tables of those that have one.  Pure NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene.flakes import flake_matrix
from clvol.scene.phase import varied_lobes
from clvol.scene.tabulated import density_points

if TYPE_CHECKING:
    from clvol.scene.boundaries import MediumEntry
    from clvol.scene.medium_facts import Matter
    from clvol.scene.records import PhaseTable


def phase_table(entries: tuple[MediumEntry, ...], matter: Matter) -> np.ndarray:
    """One PHASE record per lobe of each medium, in the order that `phase_first` counts in.

    Where some mixture's weight is a volume, each medium's lobes have as many records behind them that say how
    shares vary (cl/phase/varied.h).  Tables follow, each once, as records of three floats
    (cl/phase/tabphase.h, cl/phase/sggx.h).
    """
    varied = any(e.medium.phase_weight is not None for e in entries)
    rows: list[tuple[int, float, float]] = []
    tables: list[tuple[int, PhaseTable | tuple[float, ...]]] = []
    for entry, number in zip(entries, matter.of_entry, strict=True):
        lobes = varied_lobes(entry.medium.phase)
        for lobe, share, _ in lobes:
            table = lobe.table if lobe.flakes is None else lobe.flakes
            tables += [] if table is None else [(len(rows), table)]
            rows.append((layout.enum("PHASE", lobe.kind), lobe.g, share))
        volume = matter.roles[number].get("phase_weight", -1)
        rows += [(volume, slope, 0.0) for _, _, slope in lobes] if varied else []
    parts = [np.array(rows, layout.PHASE)]
    places: dict[PhaseTable | tuple[float, ...], int] = {}
    end = len(rows)
    for row, table in tables:
        if table not in places:
            places[table] = end
            parts.append(_flakes(table) if isinstance(table, tuple) else _points(table))
            end += len(parts[-1])
        parts[0]["g"].view(np.int32)[row] = places[table] - row
    return np.concatenate(parts)


def _flakes(values: tuple[float, ...]) -> np.ndarray:
    """The two triangles of an sggx (cl/phase/sggx.h), as records."""
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
