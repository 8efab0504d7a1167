"""Phase functions as device records, and the tables of those that have one.  Pure NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene.phase import phase_lobes
from clvol.scene.tabulated import density_points

if TYPE_CHECKING:
    from clvol.scene.boundaries import MediumEntry
    from clvol.scene.records import PhaseTable


def phase_table(entries: tuple[MediumEntry, ...]) -> np.ndarray:
    """One PHASE record per lobe of each medium, in the order that `phase_first` counts in.

    Tables follow, each once, as records of three floats (cl/phase/tabphase.h).
    """
    lobes = [lobe for e in entries for lobe in phase_lobes(e.medium.phase)]
    records = np.array([(layout.enum("PHASE", p.kind), p.g, share) for p, share in lobes], layout.PHASE)
    parts = [records]
    places: dict[PhaseTable, int] = {}
    end = len(records)
    for number, (phase, _) in enumerate(lobes):
        if phase.table is None:
            continue
        if phase.table not in places:
            places[phase.table] = end
            parts.append(_points(phase.table))
            end += len(parts[-1])
        records["g"].view(np.int32)[number] = places[phase.table] - number
    return np.concatenate(parts)


def _points(table: PhaseTable) -> np.ndarray:
    """The number of the last point, then the points, as records."""
    columns = density_points(table)
    rows = np.zeros((len(columns[0]) + 1, 3), np.float32)
    rows[0, :1].view(np.int32)[0] = len(columns[0]) - 1
    rows[1:] = np.stack(columns, axis=1)
    points: np.ndarray = rows.view(layout.PHASE)[:, 0]
    return points
