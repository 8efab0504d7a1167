"""Polygons as triangles that cover what the polygons cover, and corners as vertices."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import mapbox_earcut
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

log = logging.getLogger("clvol")

_ROUNDING = 1e-9
"""Areas that differ by about this share of the polygon's are the same."""
_CHUNK = 2**16
"""Polygons looked at together."""


def triangulate(points: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Triangles of polygons whose corners, as many as `sizes` says, lie in a row, (n, 3) numbers of corners.

    A polygon becomes the fan (0, k, k + 1) where that covers it, as it does where it is convex, else what
    ear clipping makes of it, all round the polygon's normal (Newell's).  One that crosses itself has no
    inside that all would agree on: it becomes its fan, with a warning.  The way round is kept, and every
    edge of a polygon is an edge of a triangle (unless it touches itself), so that closed meshes stay closed.

    points : of the corners, (c, 3).
    """
    triangles = _fans(sizes)
    counts = sizes - 2
    first, start = np.cumsum(counts) - counts, np.cumsum(sizes) - sizes
    kept, crossing = np.ones(len(triangles), bool), 0
    for many in _chunks(np.flatnonzero(sizes > 3)):
        rows = np.repeat(first[many] - np.cumsum(counts[many]) + counts[many], counts[many])
        rows += np.arange(len(rows))
        with np.errstate(over="ignore", invalid="ignore"):
            covered, normals = _fans_that_cover(points[triangles[rows]], counts[many])
        for n, normal in zip(many[~covered].tolist(), normals[~covered], strict=True):
            found = _clip_ears(points[start[n] : start[n] + sizes[n]], normal)
            if found is None:
                crossing += 1
                continue
            triangles[first[n] : first[n] + len(found)] = found + start[n]
            kept[first[n] + len(found) : first[n] + counts[n]] = False
    if crossing:
        log.warning("%d of %d polygons cross themselves: what they cover is a guess", crossing, len(sizes))
    return triangles[kept]


def _chunks(polygons: np.ndarray) -> Iterator[np.ndarray]:
    return (polygons[n : n + _CHUNK] for n in range(0, len(polygons), _CHUNK))


def _fans(sizes: np.ndarray) -> np.ndarray:
    triangles = sizes - 2
    start = np.repeat(np.cumsum(sizes) - sizes, triangles)
    within = np.arange(len(start)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return np.stack([start, start + within + 1, start + within + 2], axis=1)


def _fans_that_cover(fans: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which polygons their fans, (t, 3, 3), cover; and the polygons' normals, twice their area long.

    A fan covers where all triangles face one way and go round once at most.  Triangles of two equal corners
    count for nothing.
    """
    first = np.cumsum(counts) - counts
    a, b, c = (np.ascontiguousarray(fans[:, n].T, np.float64) for n in range(3))
    u, v = b - a, c - a
    normals = np.stack([u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)])
    whole = np.add.reduceat(normals, first, axis=1)
    along = (normals * np.repeat(whole, counts, axis=1)).sum(axis=0) > 0
    at = ~along
    along[at] = (a == b)[:, at].all(axis=0) | (b == c)[:, at].all(axis=0) | (c == a)[:, at].all(axis=0)
    covered = np.logical_and.reduceat(along, first)
    if counts.max() > 2:  # two triangles cannot go round more than once
        angle = np.arctan2(np.linalg.norm(normals, axis=0), (u * v).sum(axis=0))
        covered &= np.add.reduceat(angle, first) < 2 * np.pi
    return covered | ~np.isfinite(whole).all(axis=0), whole.T


def _clip_ears(points: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
    """Triangles of one polygon, (n, 3); None where it crosses itself or has no area at all."""
    axis = int(np.abs(normal).argmax())
    area = abs(normal[axis])
    if area == 0:
        return None
    # leaving the longest axis of the normal out keeps the digits, and in a plane what lies within what
    flat = np.asarray(points, np.float64)[:, [(axis + 1) % 3, (axis + 2) % 3]] * (1, np.sign(normal[axis]))
    unit = np.exp2(np.round(np.log2(area) / 2))  # dividing by it keeps all bits
    flat = np.ascontiguousarray((flat - flat[0]) / unit)
    found = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
    triangles = np.asarray(found, np.int64).reshape(-1, 3)
    twice = _twice_area(flat, triangles)
    if abs(np.abs(twice).sum() - area / unit**2) > _ROUNDING:
        return None
    triangles[twice < 0] = triangles[twice < 0, ::-1]
    return _with_all_corners(flat, triangles)


def _twice_area(flat: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    (ux, uy), (vx, vy) = ((flat[triangles[:, n]] - flat[triangles[:, 0]]).T for n in (1, 2))
    area: np.ndarray = ux * vy - uy * vx
    return area


def _with_all_corners(flat: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles, cut at the corners on straight edges, which ear clipping leaves out."""
    count = len(flat)
    used = np.zeros(count, bool)
    used[triangles.reshape(-1)] = True
    rest, done = [tuple(t) for t in triangles.tolist()], []
    while rest:
        triangle = rest.pop()
        for n in range(3):
            a, b, c = (triangle[(n + k) % 3] for k in range(3))
            middle = (a + 1) % count
            while middle != b and not used[middle] and not _between(flat, a, middle, b):
                middle = (middle + 1) % count
            if middle != b and not used[middle]:
                used[middle] = True
                rest += [(a, middle, c), (middle, b, c)]
                break
        else:
            done.append(triangle)
    return np.array(done[::-1], np.int64)


def _between(flat: np.ndarray, a: int, middle: int, b: int) -> bool:
    """Whether a point on the line through two others is between them, and neither of them."""
    to_a, to_b = flat[a] - flat[middle], flat[b] - flat[middle]
    return float(to_a @ to_b) < 0 and abs(to_a[0] * to_b[1] - to_a[1] * to_b[0]) <= _ROUNDING


def distinct(columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The first corner of each combination of non-negative numbers, and which combination each corner is.

    Combinations are in the order of first use.
    """
    key = columns[0]
    for column in columns[1:]:
        key = np.unique(key, return_inverse=True)[1].astype(np.int64) * (int(column.max()) + 1) + column
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[which.reshape(-1)]
