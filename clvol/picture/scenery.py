"""Where a picture's volume is in it: what labels need to know of the scene, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from clvol.volumes.transfer import Transfers, text_of_points, transfer_of_points

AXIS_ALIGNED = 1e-6
"""Share of a side's length by which its ends may differ along other axes and still be along one."""

_SHAPES = {"start": (3,), "rows": (3, 3), "right": (3,), "corner": (3,), "edges": (3, 3)}


@dataclass(frozen=True, eq=False)
class Scenery:
    """The camera and the volume of a picture.

    Parameters
    ----------
    start : float64 (3,), where the camera is.
    rows : float64 (3, 3), that take an offset from it to (a, b, c), which is seen at pixel (a / c, b / c), or
        by parallel rays (a, b), from the top left corner, where c is above 0.
    right : float64 (3,), unit, to the right in the picture.
    corner, edges : a corner of the volume's box, float64 (3,), and the three sides from it, rows of (3, 3).
    unit : of lengths, as "mm"; "" where nobody says.
    transfers : what the medium makes of its values, if anything.  parallel : the rays of the camera are.
    """

    start: np.ndarray
    rows: np.ndarray
    right: np.ndarray
    corner: np.ndarray
    edges: np.ndarray
    unit: str = ""
    transfers: Transfers | None = None
    parallel: bool = False

    def described(self) -> dict[str, Any]:
        """All of it as numbers and text, for a file's record."""
        said = {name: getattr(self, name).tolist() for name in _SHAPES}
        said |= {"unit": self.unit, "parallel": self.parallel}
        if self.transfers is None:
            return said
        functions = {f.name: getattr(self.transfers, f.name) for f in fields(self.transfers)}
        return said | {"transfers": {n: text_of_points(f) for n, f in functions.items() if f is not None}}

    @classmethod
    def read(cls, said: Any) -> Scenery | None:
        """What `described` says; None for None; KeyError, TypeError or ValueError for what it never says."""
        if said is None:
            return None
        arrays = {name: np.array(said[name], np.float64) for name in _SHAPES}
        for name, shape in _SHAPES.items():
            if arrays[name].shape != shape or not np.isfinite(arrays[name]).all():
                raise ValueError(f"{name} of the scenery is not {shape} finite numbers")
        functions = said.get("transfers")
        made = {name: transfer_of_points(str(text)) for name, text in functions.items()} if functions else {}
        transfers = Transfers(**made) if made else None
        return cls(**arrays, unit=str(said["unit"]), transfers=transfers, parallel=bool(said["parallel"]))

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) as x and y in pixels, and a number above 0 in front of the camera; (3, n)."""
        a, b, c = self.rows @ (points - self.start).T
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([a, b, c] if self.parallel else [a / c, b / c, c])

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
