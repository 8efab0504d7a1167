"""Transfer functions as the device reads them: the points of all of them, and where each medium's are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene import records


def transfer_tables(media: Sequence[records.Medium]) -> tuple[np.ndarray, np.ndarray]:
    """TRANSFER records of media, by number, one for each of `ENUMS["TRANSFER"]`; and points, float32 (n, 4).

    A point is a value and its colour.
    """
    roles = [role.lower() for role in layout.ENUMS["TRANSFER"]]
    table = np.zeros((len(media), len(roles)), layout.TRANSFER)
    points: list[np.ndarray] = [np.zeros((0, 4), np.float32)]
    first = 0
    for row, medium in zip(table, media, strict=True):
        for record, transfer in zip(row, map(medium.transfer, roles), strict=True):
            if transfer is not None:
                points.append(np.column_stack([transfer.values, transfer.colours]))
                record["first"], record["count"] = first, len(transfer.values)
                first += len(transfer.values)
    return table.reshape(-1), np.concatenate(points)
