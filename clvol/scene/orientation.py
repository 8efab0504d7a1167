"""Which way a mesh that bounds a medium faces: closed parts that face inwards are turned."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.mesh import merged_vertices

if TYPE_CHECKING:
    from clvol.scene.records import Mesh

_MOST_TESTS = 1_000
"""Parts that may lie inside of others are looked at up to so many pairs; beyond, none is turned."""


def facing_outwards(mesh: Mesh) -> tuple[Mesh, int]:
    """The mesh with its closed parts turned that face inwards all over, and how many these are.

    A part is what hangs together by vertices at the same place.  It faces inwards where the volume that its
    winding encloses is negative (divergence theorem), unless it lies inside of an odd number of others: then
    it is the wall of a cavity, and right.  In a part that is turned, walls of cavities that face outwards are
    turned as well: the file is inside out as a whole.
    """
    corners = merged_vertices(mesh.vertices)[mesh.faces]
    count, part = _parts(corners)
    volumes = np.bincount(part, _volumes(mesh), count)
    closed = _closed(corners, part, count)
    inwards, outwards = (np.flatnonzero(closed & side).tolist() for side in (volumes < 0, volumes > 0))
    if not inwards:
        return mesh, 0
    nesting = _Nesting(mesh, part, count)
    try:
        turned = [n for n in inwards if len(nesting.around(n)) % 2 == 0]
        walls = ((n, nesting.around(n)) for n in outwards if turned)
        turned += [n for n, around in walls if len(around) % 2 == 1 and not set(around).isdisjoint(turned)]
    except _TooManyPartsError:
        return mesh, 0
    if not turned:
        return mesh, 0
    faces = mesh.faces.copy()
    flipped = np.isin(part, turned)
    faces[flipped] = faces[flipped][:, ::-1]
    return replace(mesh, faces=faces, normals=_turned_normals(mesh, flipped)), len(turned)


class _TooManyPartsError(Exception):
    """More pairs of parts to look at than are worth it."""


class _Nesting:
    """Which parts of a mesh lie inside of which: by their boxes first, then by a point of the inner one."""

    def __init__(self, mesh: Mesh, part: np.ndarray, count: int) -> None:
        self.mesh, self.part, self.tests = mesh, part, 0
        self.first = np.unique(part, return_index=True)[1]
        self.lower, self.upper = (np.full((count, 3), end) for end in (np.inf, -np.inf))
        for n in range(3):
            np.minimum.at(self.lower, part, mesh.vertices[mesh.faces[:, n]])
            np.maximum.at(self.upper, part, mesh.vertices[mesh.faces[:, n]])

    def around(self, number: int) -> list[int]:
        """The parts that a part lies inside of."""
        boxes = (self.lower <= self.lower[number]) & (self.upper >= self.upper[number])
        candidates = [int(n) for n in np.flatnonzero(boxes.all(axis=1)) if n != number]
        self.tests += len(candidates)
        if self.tests > _MOST_TESTS:
            raise _TooManyPartsError
        vertices, faces = self.mesh.vertices, self.mesh.faces
        point = vertices[faces[self.first[number]]].mean(axis=0, dtype=np.float64)
        return [n for n in candidates if _is_inside(point, vertices[faces[self.part == n]])]


def _parts(corners: np.ndarray) -> tuple[int, np.ndarray]:
    """How many parts there are, and the part of each triangle."""
    from scipy.sparse import coo_array  # takes longer to import than most scenes to prepare
    from scipy.sparse.csgraph import connected_components

    size = int(corners.max()) + 1
    a, b, c = corners.T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, c])
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), (size, size))
    label = connected_components(graph, directed=False)[1]
    found, part = np.unique(label[a], return_inverse=True)
    return len(found), part.reshape(-1)


def _closed(corners: np.ndarray, part: np.ndarray, count: int) -> np.ndarray:
    """Whether every edge of a part is run through as often one way as the other; bool (count,)."""
    start, end = (
        corners.reshape(-1).astype(np.int64),
        np.roll(corners, -1, axis=1).reshape(-1).astype(np.int64),
    )
    key = np.minimum(start, end) * (int(corners.max()) + 1) + np.maximum(start, end)
    _, first, edge = np.unique(key, return_index=True, return_inverse=True)
    balance = np.bincount(edge.reshape(-1), np.sign(end - start))
    closed = np.ones(count, bool)
    closed[part[first[balance != 0] // 3]] = False
    return closed


def _volumes(mesh: Mesh) -> np.ndarray:
    """What each triangle adds to the volume, about the middle of the mesh; float64 (triangles,)."""
    middle = mesh.vertices.mean(axis=0, dtype=np.float64)
    a, b, c = (mesh.vertices[mesh.faces[:, n]].astype(np.float64) - middle for n in range(3))
    volumes: np.ndarray = (a * np.cross(b, c)).sum(axis=1) / 6
    return volumes


def _is_inside(point: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a closed part is round a point.

    Its winding number there, by solid angles (Van Oosterom and Strackee 1983), which no ray through an edge
    can get wrong.
    """
    a, b, c = (triangles[:, n].astype(np.float64) - point for n in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return bool(abs(np.arctan2(volume, below).sum()) > np.pi)


def _turned_normals(mesh: Mesh, flipped: np.ndarray) -> np.ndarray | None:
    """Normals of the vertices of flipped triangles turned, where they face as the triangles did."""
    if mesh.normals is None:
        return None
    corners = mesh.faces[flipped]
    a, b, c = (mesh.vertices[corners[:, n]].astype(np.float64) for n in range(3))
    flat = np.cross(b - a, c - a)
    if (mesh.normals[corners].sum(axis=1) * flat).sum() < 0:  # they faced outwards all the time
        return mesh.normals
    normals = mesh.normals.copy()
    vertices = np.unique(corners)
    normals[vertices] = -normals[vertices]
    return normals
