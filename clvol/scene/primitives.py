"""Which shapes are met in closed form; the cube and the rectangle as triangles, with Mitsuba's uv."""

from __future__ import annotations

from functools import cache

import numpy as np

from clvol.layout import ENUMS
from clvol.scene.records import Mesh, Shape

QUADRICS = tuple(map(str.lower, ENUMS["QUADRIC"]))
"""Kinds of shape that stay what they are on the device; all others are triangles there."""
_CUBE = np.array(  # each face counter-clockwise from its corner at (u, v) = (0, 1), towards (1, 1)
    [
        [(1, -1, -1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1)],
        [(1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1)],
        [(1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)],
        [(1, -1, 1), (1, 1, 1), (-1, 1, 1), (-1, -1, 1)],
        [(-1, -1, 1), (-1, 1, 1), (-1, 1, -1), (-1, -1, -1)],
        [(1, 1, -1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1)],
    ],
    np.float32,
)
_SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)


@cache
def canonical_mesh(kind: str) -> Mesh:
    """The "cube" (−1..1)³ or the "rectangle" (−1..1)² with normal +z, in local space, with faces' normals.

    KeyError for another kind.
    """
    return {"cube": _cube, "rectangle": _rectangle}[kind]()


def mesh_of(shape: Shape) -> Mesh:
    """The triangles of a shape that is made of them: its own, or those of its kind; else KeyError."""
    return canonical_mesh(shape.kind) if shape.mesh is None else shape.mesh


def _cube() -> Mesh:
    uvs = np.tile(np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32), (6, 1))
    return Mesh(_CUBE.reshape(-1, 3).copy(), _halves(6), None, uvs, "cube")


def _rectangle() -> Mesh:
    return Mesh(_SQUARE.copy(), _halves(1), None, (_SQUARE[:, :2] + 1) / 2, "rectangle")


def _halves(quads: int) -> np.ndarray:
    """Two triangles for every four vertices, int32."""
    first = 4 * np.arange(quads)[:, None, None]
    faces: np.ndarray = (first + np.array([(0, 1, 2), (3, 0, 2)])).reshape(-1, 3)
    return faces.astype(np.int32)
