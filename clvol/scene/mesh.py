"""Triangle meshes: what a file's triangles must be to be rendered, their smooth normals, and their flaws."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.records import Mesh

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

log = logging.getLogger("clvol")

MAX_INDICES = 2**31 - 1
FAR = 8.0
"""A mesh this many times its size away from its origin gets an origin of its own: floats are coarse there."""
UNIT = 2.0**-23
"""How far the length of a float32 vector that was made unit is from 1 at most."""
_CHUNK = 2**17
"""Triangles worked on at a time: what is worked out for each corner needs several times a mesh's memory."""


@dataclass(frozen=True, eq=False)
class RawMesh:
    """A file's triangles: vertices (n, 3), integer faces (m, 3), normals (n, 3) and uvs (n, 2) or None.

    without_uvs : bool (n,), the vertices that have no texture coordinates though others do; None: all have.
    Normals of length 0 are worked out.
    attributes : of vertices or faces, (n or m, 1 or 3), by names like vertex_color and face_color.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uvs: np.ndarray | None = None
    without_uvs: np.ndarray | None = None
    attributes: Mapping[str, np.ndarray] = field(default_factory=dict)


def build_mesh(raw: RawMesh, source: str, smooth: bool) -> tuple[Mesh, np.ndarray]:
    """The mesh of a file, and the point (float64 (3,)) that its vertices are relative to.

    Triangles without an area are dropped, and counted in the log.  `smooth`: the file's normals, or else, as
    in Mitsuba, means of the faces round each vertex, weighted by their angles there; if not, there are none.

    Raises
    ------
    ValueError
        No triangles, indices that point nowhere, or values that are not finite as floats.
    """
    vertices, faces = np.asarray(raw.vertices), np.asarray(raw.faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise ValueError("it has no triangles")
    if 3 * len(faces) > MAX_INDICES or len(vertices) > MAX_INDICES:
        raise ValueError(f"it has {len(faces)} triangles, at most {MAX_INDICES // 3} can be indexed")
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= len(vertices):
        raise ValueError(f"a triangle names vertex {low if low < 0 else high} of {len(vertices)}")
    origin = _origin(vertices)
    with np.errstate(over="ignore"):
        local = np.ascontiguousarray(vertices - origin, dtype=np.float32)
    _check_finite(local, "vertex")
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    with_area = _with_area(local, faces, source)
    once = _once(local, faces[with_area], source)
    faces = faces[with_area][once]
    attributes = {
        name: _attribute(name, values[with_area][once] if name.startswith("face_") else values)
        for name, values in raw.attributes.items()
    }
    uvs = None if raw.uvs is None else np.ascontiguousarray(raw.uvs, dtype=np.float32)
    if uvs is not None:
        _check_finite(uvs, "texture coordinate")
    normals = _normals(local, faces, raw.normals) if smooth else None
    return Mesh(local, faces, normals, uvs, source, attributes), origin


def _attribute(name: str, values: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        made = np.ascontiguousarray(values, dtype=np.float32)
    _check_finite(made, f"{name} number")
    return made


def _check_finite(values: np.ndarray, what: str) -> None:
    broken = ~np.isfinite(values).all(axis=1)
    if broken.any():
        raise ValueError(f"{what} {int(broken.argmax())} is not finite")


def _origin(vertices: np.ndarray) -> np.ndarray:
    """The middle of a mesh that lies far from (0, 0, 0), else (0, 0, 0)."""
    lower, upper = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        middle, size = lower / 2 + upper / 2, np.linalg.norm(upper - lower)
        return middle if np.linalg.norm(middle) > FAR * size else np.zeros(3)


def _chunks(count: int) -> Iterator[slice]:
    return (slice(first, first + _CHUNK) for first in range(0, count, _CHUNK))


def _cross(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals with the length of twice the area, float64 (m, 3).

    They are exactly 0 where there is no area, since the products of differences of floats are exact in
    double.
    """
    a, b, c = (vertices[faces[:, n]].astype(np.float64) for n in range(3))
    return np.cross(b - a, c - a)


def _with_area(vertices: np.ndarray, faces: np.ndarray, source: str) -> np.ndarray | slice:
    """The faces that have an area."""
    kept = np.concatenate([_cross(vertices, faces[part]).any(axis=1) for part in _chunks(len(faces))])
    if kept.all():
        return slice(None)
    if not kept.any():
        raise ValueError("none of its triangles has an area")
    log.warning("%s: %d of %d triangles have no area and are left out", source, (~kept).sum(), len(faces))
    return kept


def _once(vertices: np.ndarray, faces: np.ndarray, source: str) -> np.ndarray | slice:
    """The faces but those that lie where another does, turned alike: light would pass them twice.

    Looked for among those alone whose vertices' places have the same sum, mixed to 64 bits.
    """
    sums = _place_sums(vertices, faces)
    ordered = np.sort(sums)
    twice = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    if not len(twice):
        return slice(None)
    candidates = np.flatnonzero(np.isin(sums, twice))
    corners = merged_vertices(vertices[faces[candidates].reshape(-1)]).reshape(-1, 3)
    least = corners.argmin(axis=1)
    rows = np.stack([corners[np.arange(len(corners)), (least + n) % 3] for n in range(3)], axis=1)
    first = np.unique(rows, axis=0, return_index=True)[1]
    extra = np.delete(candidates, first)
    if not len(extra):
        return slice(None)
    log.warning("%s: %d of %d triangles are there twice and left out", source, len(extra), len(faces))
    return np.delete(np.arange(len(faces)), extra)


def _place_sums(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """A number for each face that depends on where its vertices are, in any order; uint64 (m,)."""
    mixed = np.zeros(len(vertices), np.uint64)
    for axis in range(3):  # xor and multiply, as in SplitMix64
        mixed ^= (vertices[:, axis] + np.float32(0)).view(np.uint32)
        mixed *= np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> np.uint64(29)
    sums = np.empty(len(faces), np.uint64)
    for part in _chunks(len(faces)):
        sums[part] = mixed[faces[part]].sum(axis=1)
    return sums


def _normals(vertices: np.ndarray, faces: np.ndarray, given: np.ndarray | None) -> np.ndarray:
    """Unit normals of the vertices, float32 (n, 3): those given, else computed (also where they are 0).

    Those given that are unit in single precision stay as they are, so that a mesh that is written and read
    again is the same.
    """
    if given is not None:
        _check_finite(given, "normal")
        length = np.linalg.norm(given, axis=1)
        length[np.abs(length - 1) < UNIT] = 1
        if (length[faces.reshape(-1)] > 0).all():
            return (given / np.where(length > 0, length, 1)[:, None]).astype(np.float32)
    normals = smooth_normals(vertices, faces)
    if given is not None:
        known = length > 0
        normals[known] = given[known] / length[known, None]
    return normals


def smooth_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals of vertices from the faces round them, weighted by the angles there (Thürmer, Wüthrich 1998).

    Vertices of no face get (0, 0, 1), those whose faces cancel out one face's normal.  float32 (n, 3).
    """
    count = len(vertices)
    sums = np.zeros((count, 3))
    for part in _chunks(len(faces)):
        corners = faces[part]
        flat = _unit(_cross(vertices, corners))
        for n in range(3):
            here, after, before = (vertices[corners[:, (n + k) % 3]].astype(np.float64) for k in range(3))
            u, v = _unit(after - here), _unit(before - here)
            # 2 asin(|u − v| / 2) keeps its digits at small angles, where acos(u·v) does not (Kahan)
            opposed = (u * v).sum(axis=1) < 0
            chord = np.linalg.norm(np.where(opposed[:, None], u + v, u - v), axis=1)
            angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
            angle = np.where(opposed, np.pi - angle, angle)
            np.add.at(sums, corners[:, n], angle[:, None] * flat)
    length = np.linalg.norm(sums, axis=1)
    lost = length < 1e-9
    if lost.any():
        sums[lost] = (0, 0, 1)
        for part in _chunks(len(faces)):
            flat = _unit(_cross(vertices, faces[part]))
            for n in range(3):
                at = lost[faces[part][:, n]]
                sums[faces[part][at, n]] = flat[at]
        length[lost] = 1
    sums /= length[:, None]
    return sums.astype(np.float32)


def _unit(v: np.ndarray) -> np.ndarray:
    unit: np.ndarray = v / np.linalg.norm(v, axis=1, keepdims=True)
    return unit


def mesh_flaws(mesh: Mesh) -> list[str]:
    """What keeps a mesh from bounding a volume, in words; empty for a closed one that faces outwards.

    Positions count as one where they are equal exactly: texture seams and hard edges split vertices only.
    """
    corners = merged_vertices(mesh.vertices)[mesh.faces]
    start, end = corners.reshape(-1), np.roll(corners, -1, axis=1).reshape(-1)
    proper = start != end
    start, end = start[proper], end[proper]
    key = np.minimum(start, end) * len(mesh.vertices) + np.maximum(start, end)
    edges, edge = np.unique(key, return_inverse=True)
    forward = np.bincount(edge.reshape(-1), start < end, len(edges))
    total = np.bincount(edge.reshape(-1), minlength=len(edges))
    open_edges = int((total % 2 == 1).sum())
    against = int(((total % 2 == 0) & (2 * forward != total)).sum())
    flaws = []
    if open_edges:
        flaws.append(f"{open_edges} open edge{'s' if open_edges > 1 else ''}")
    if against:
        flaws.append(f"{against} edge{'s' if against > 1 else ''} whose triangles face opposite sides")
    if not flaws:
        volume = _volume(mesh)
        if volume < 0:
            flaws.append(f"triangles that face inwards (volume {volume:.4g})")
        elif volume == 0:
            flaws.append("no volume inside")
    return flaws


def merged_vertices(vertices: np.ndarray) -> np.ndarray:
    """A number for each vertex, the same for the same position; int64 (n,)."""
    positive_zeros = np.asarray(vertices, np.float32) + np.float32(0)
    bits = positive_zeros.view(np.uint32).astype(np.uint64)
    number = bits[:, 0]
    for axis in (1, 2):
        packed = number << np.uint64(32) | bits[:, axis]
        number = np.unique(packed, return_inverse=True)[1].reshape(-1).astype(np.uint64)
    return number.astype(np.int64)


def _volume(mesh: Mesh) -> float:
    """Signed volume, by the divergence theorem, about the middle of the mesh."""
    middle = mesh.vertices.mean(axis=0, dtype=np.float64)
    total = 0.0
    for part in _chunks(len(mesh.faces)):
        a, b, c = (mesh.vertices[mesh.faces[part, n]].astype(np.float64) - middle for n in range(3))
        total += float((a * np.cross(b, c)).sum()) / 6
    return total
