"""Where a picture's volume is in it: what labels need to know of the scene, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.volumes.transfer import Transfers

AXIS_ALIGNED = 1e-6
"""Share of a side's length by which its ends may differ along other axes and still be along one."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """The camera and the volume of a picture.

    Parameters
    ----------
    place : takes points (n, 3) in the world to (3, n): x and y in pixels from the top left corner, and a
        number that is above 0 where they are in front of the camera.
    right : float64 (3,), unit, to the right in the picture.
    corner, edges : a corner of the volume's box, float64 (3,), and the three sides from it, rows of (3, 3).
    unit : of lengths, as "mm"; "" where nobody says.
    transfers : what the medium makes of its values, if anything.
    """

    place: Callable[[np.ndarray], np.ndarray]
    right: np.ndarray
    corner: np.ndarray
    edges: np.ndarray
    unit: str = ""
    transfers: Transfers | None = None

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3) in the world; NaN of those behind the camera."""
        x, y, depth = self.place(points)
        return np.where(depth[:, None] > 0, np.stack([x, y], axis=1), np.nan)

    @property
    def middle(self) -> np.ndarray:
        """Of the box."""
        centre: np.ndarray = self.corner + self.edges.sum(axis=0) / 2
        return centre

    def corner_at(self, along: tuple[float, float, float]) -> np.ndarray:
        """A point of the box by shares of its sides; 0 or 1 each are its corners."""
        point: np.ndarray = self.corner + np.array(along) @ self.edges
        return point

    def extent(self, side: int) -> tuple[str, float, float]:
        """What a side is called, and what is at its ends: coordinates of the world, or else lengths."""
        edge, length = self.edges[side], float(np.linalg.norm(self.edges[side]))
        axis = int(np.abs(edge).argmax())
        if np.abs(np.delete(edge, axis)).max() <= AXIS_ALIGNED * length:
            start = float(self.corner[axis])
            return "xyz"[axis], start, start + float(edge[axis])
        return "ijk"[side], 0.0, length
