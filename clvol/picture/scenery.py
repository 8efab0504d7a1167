"""Where a picture's volume is in it: what labels need to know of the scene, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from clvol.volumes.transfer import Transfers

AXIS_ALIGNED = 1e-6
"""Share of a side's length by which its ends may differ along other axes and still be along one."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """The camera and the volume of a picture.

    Parameters
    ----------
    eye : float64 (3,), where the camera is.  rows : float64 (3, 3), that take an offset from it to (a, b, c),
        which is seen at pixel (a / c, b / c), from the top left corner, where c is above 0.
    right : float64 (3,), unit, to the right in the picture.
    corner, edges : a corner of the volume's box, float64 (3,), and the three sides from it, rows of (3, 3).
    unit : of lengths, as "mm"; "" where nobody says.
    transfers : what the medium makes of its values, if anything.
    """

    eye: np.ndarray
    rows: np.ndarray
    right: np.ndarray
    corner: np.ndarray
    edges: np.ndarray
    unit: str = ""
    transfers: Transfers | None = None

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3) in the world; NaN of those behind the camera."""
        a, b, c = self.rows @ (points - self.eye).T
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = np.stack([a / c, b / c], axis=1)
        return np.where(c[:, None] > 0, seen, np.nan)

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
