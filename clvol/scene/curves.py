"""The `bsplinecurve` and `linearcurve` shapes as tubes of triangles.

Circles round the curve become polygons of `AROUND` sides of the same circumference, so that a tube is as wide
as the curve on the mean over all sides it is seen from.  Along a spline, steps are so short that no chord is
farther from it than `TOLERANCE` of its radius.  Normals are those of the curve's surface.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.base.memory import available_memory, format_bytes
from clvol.scene.files import find_parameter
from clvol.scene.mesh import MAX_INDICES, RawMesh, build_mesh

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene.reader import Reader
    from clvol.scene.records import Mesh

AROUND = 16
"""Sides of a tube: its surface lies within 1.3 % of the radius from the curve's."""
TOLERANCE = 0.01
MOST_STEPS = 64
"""Most steps along a piece of a spline."""
_BYTES_A_TRIANGLE = 200
_ROUNDING = 1e-9
"""Of a spline's derivatives."""
_SLANTED = 0.1
"""Squared sine between a curve and an axis beyond which frames may follow the axis."""
_BASIS = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
"""Powers of t from four control points of a uniform cubic B-spline."""


def read_curves(reader: Reader, to_world: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """The tubes of a file of curves in the world, and the point (float64 (3,)) they are relative to.

    A line of the file has x, y, z and the radius of a control point; empty lines divide curves.  `to_world`
    moves points and leaves radii as they are, as in Mitsuba.
    """
    if not reader.has("filename"):
        reader.fail(f"shape '{reader.type}' needs a filename")
    path, spline = find_parameter(reader, "filename"), reader.type == "bsplinecurve"
    try:
        curves = parse_curves(path.read_text(errors="replace"), 4 if spline else 2)
        for points in curves:
            points[:, :3] = points[:, :3] @ to_world[:3, :3].T + to_world[:3, 3]
        made = build_mesh((_splines if spline else _polylines)(curves), str(path), smooth=True)
    except ValueError as error:
        reader.fail(f"curves '{path}': {error}", "filename")
    reader.approximated(
        f"tubes of triangles, within {TOLERANCE + 0.013:.1%} of their radius; u begins anywhere round them"
    )
    return made


def parse_curves(text: str, least: int) -> list[np.ndarray]:
    """Control points x, y, z, radius of each curve, float64 (n, 4); ValueError for what is none."""
    curves: list[list[list[float]]] = [[]]
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words:
            curves.append([])
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != 4:
            raise ValueError(f"line {number} is not x, y, z and a radius")
        curves[-1].append(values)
    found = [np.array(curve) for curve in curves if curve]
    if not found:
        raise ValueError("it has no control points")
    for curve in found:
        if len(curve) < least:
            raise ValueError(f"a curve has {len(curve)} control points, and needs {least}")
        if not np.isfinite(curve).all() or (np.abs(curve) > 1e30).any():
            raise ValueError("a control point is not finite")
        if (curve[:, 3] < 0).any():
            raise ValueError(f"a radius is {curve[:, 3].min():g}")
    return found


def _splines(curves: Sequence[np.ndarray]) -> RawMesh:
    """Tubes along cubic B-splines, whose radii are splines too; each has three pieces less than points."""
    corners = [np.stack([c[n : len(c) - 3 + n] for n in range(4)], axis=1) for c in curves]
    steps = [_steps(pieces) for pieces in corners]
    _check_size(sum(int(count.sum()) for count in steps))
    total, first, tubes = sum(map(len, corners)), 0, []
    for pieces, count in zip(corners, steps, strict=True):
        piece = np.append(np.repeat(np.arange(len(pieces)), count), len(pieces) - 1)
        start = np.repeat(np.cumsum(count) - count, count)
        t = np.append((np.arange(len(piece) - 1) - start) / count[piece[:-1]], 1.0)
        powers = np.einsum("ij,pjk->pik", _BASIS, pieces)[piece]
        values = ((powers[:, 3] * t[:, None] + powers[:, 2]) * t[:, None] + powers[:, 1]) * t[:, None]
        tubes.append(_tube(values + powers[:, 0], _slopes(powers, t), (first + piece + t) / total))
        first += len(pieces)
    return _joined(tubes)


def _slopes(powers: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Which way a spline goes on at `t` of pieces by powers of t, both of one length; the last is its end.

    Where its slope is 0, as where three control points are one, that is the first of the higher derivatives
    that is not: there the curve sets off along it, and at the end arrives against or along it.
    """
    t = t[:, None]
    second, third = 6 * powers[:, 3] * t + 2 * powers[:, 2], 6 * powers[:, 3]
    slopes: np.ndarray = (3 * powers[:, 3] * t + 2 * powers[:, 2]) * t + powers[:, 1]
    arriving = np.where(np.arange(len(t)) < len(t) - 1, 1.0, -1.0)[:, None]
    sizes = np.abs(powers[:, :, :3]).max(axis=2)
    nothing = np.maximum(_ROUNDING * sizes[:, 1:].max(axis=1), 1e-14 * sizes[:, 0])
    for derivative in (arriving * second, third):
        still = np.linalg.norm(slopes[:, :3], axis=1) <= nothing
        slopes[still] = derivative[still]
    known = np.flatnonzero(np.linalg.norm(slopes[:, :3], axis=1) > nothing)
    if len(known):  # pieces that are a point lie across their neighbours' way
        slopes = slopes[known[np.searchsorted(known, np.arange(len(t))).clip(max=len(known) - 1)]]
    return slopes


def _steps(pieces: np.ndarray) -> np.ndarray:
    """Steps along each piece (n, 4, 4): chords of a curve are h² / 8 of its second derivative from it."""
    second = np.abs(np.diff(pieces, 2, axis=1)).max(axis=1)
    bend, radius = np.linalg.norm(second, axis=1), pieces[:, :, 3].mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        wanted = np.nan_to_num(np.sqrt(bend / (8 * TOLERANCE * radius)), posinf=MOST_STEPS)
    steps: np.ndarray = np.clip(np.ceil(wanted), 1, MOST_STEPS).astype(np.int64)
    return steps


def _polylines(curves: Sequence[np.ndarray]) -> RawMesh:
    """Balls round all points, and cones that touch those of neighbours."""
    _check_size(sum(len(c) - 1 for c in curves) + AROUND // 2 * sum(map(len, curves)))
    total, first, parts = sum(len(c) - 1 for c in curves), 0, []
    for curve in curves:
        way = np.diff(curve, axis=0)
        length = np.linalg.norm(way[:, :3], axis=1)
        for n in np.flatnonzero(length > np.abs(way[:, 3])):
            lean = -way[n, 3] / length[n]
            along = np.append(way[n, :3] / length[n], 0)
            ends = curve[n : n + 2] + lean * curve[n : n + 2, 3:] * along
            ends[:, 3] *= np.sqrt(1 - lean * lean)
            v = (first + n + np.array([0, 1])) / total
            parts.append(_tube(ends, np.repeat(np.diff(ends, axis=0), 2, axis=0), v))
        parts += [_ball(point, (first + n) / total) for n, point in enumerate(curve) if point[3] > 0]
        first += len(curve) - 1
    if not parts:
        raise ValueError("its segments have no length, and its points no radius")
    return _joined(parts)


def _check_size(rings: int) -> None:
    triangles, free = 2 * AROUND * rings, available_memory()
    needed = _BYTES_A_TRIANGLE * triangles
    if 3 * triangles > MAX_INDICES or (free is not None and needed > free):
        raise ValueError(f"its tubes have {triangles:,} triangles, which take {format_bytes(needed)}")


def _tube(points: np.ndarray, slopes: np.ndarray, v: np.ndarray) -> RawMesh:
    """A tube through circles round `points` (n, 4: x, y, z, radius) across `slopes`; `v` of each."""
    length = np.linalg.norm(slopes[:, :3], axis=1)
    across, other = _frames(slopes[:, :3] / np.maximum(length, 1e-300)[:, None])
    turn = 2 * np.pi * np.arange(AROUND + 1) / AROUND
    radial = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * other[:, None]
    wide = np.pi / AROUND / np.sin(np.pi / AROUND)
    vertices = points[:, None, :3] + wide * points[:, 3, None, None] * radial
    tangent = slopes[:, :3] / np.maximum(length, 1e-300)[:, None]
    normals = radial * length[:, None, None] - (slopes[:, 3:] * tangent)[:, None]
    uvs = np.stack(np.broadcast_arrays(turn / (2 * np.pi), v[:, None]), axis=-1)
    return _grid(vertices, normals, uvs)


def _ball(point: np.ndarray, v: float) -> RawMesh:
    """A ball, of half as many rings as it has sides; all of one `v`."""
    theta = np.pi * np.arange(AROUND // 2 + 1) / (AROUND // 2)
    turn = 2 * np.pi * np.arange(AROUND + 1) / AROUND
    flat = np.stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))], axis=1)
    normals = np.sin(theta)[:, None, None] * flat - np.cos(theta)[:, None, None] * np.array([0.0, 0.0, 1.0])
    wide = np.pi / AROUND / np.sin(np.pi / AROUND)
    uvs = np.stack(np.broadcast_arrays(turn / (2 * np.pi), np.full((len(theta), 1), v)), axis=-1)
    return _grid(point[:3] + wide * point[3] * normals, normals, uvs, poles=True)


def _grid(vertices: np.ndarray, normals: np.ndarray, uvs: np.ndarray, poles: bool = False) -> RawMesh:
    """Triangles between rings, outwards; arrays (rings, AROUND + 1, 2 or 3).

    `poles`: the first ring and the last are points.
    """
    rings, sides = vertices.shape[:2]
    first = (sides * np.arange(rings - 1)[:, None] + np.arange(sides - 1)).reshape(-1)
    lower = np.stack([first, first + 1, first + sides], axis=1)
    upper = np.stack([first + 1, first + sides + 1, first + sides], axis=1)
    if poles:
        lower, upper = lower[sides - 1 :], upper[: 1 - sides]
    flat = (array.reshape(-1, array.shape[-1]) for array in (vertices, normals, uvs))
    points, turned, places = flat
    return RawMesh(points, np.concatenate([lower, upper]), turned, places)


def _frames(tangents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each tangent (n, 3), which turn as little as may be from one to the next."""
    away = 1 - tangents**2  # of each coordinate axis from the tangents, squared sines
    best = away.min(axis=0).argmax()
    if away[:, best].min() > _SLANTED:  # one axis will do for all
        across = np.eye(3)[best] - tangents * tangents[:, best, None]
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        return across, np.cross(tangents, across)
    across = np.zeros_like(tangents)
    axis = np.zeros(3)
    axis[np.abs(tangents[0]).argmin()] = 1
    for n, tangent in enumerate(tangents):
        axis = axis - tangent * (axis @ tangent)
        size = np.linalg.norm(axis)
        if size < 1e-6:  # it doubles back: any will do
            axis = np.zeros(3)
            axis[np.abs(tangent).argmin()] = 1
            axis -= tangent * (axis @ tangent)
            size = np.linalg.norm(axis)
        axis = across[n] = axis / size
    return across, np.cross(tangents, across)


def _joined(parts: Sequence[RawMesh]) -> RawMesh:
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return RawMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]),
        np.concatenate([part.normals for part in parts if part.normals is not None]),
        np.concatenate([part.uvs for part in parts if part.uvs is not None]),
    )
