"""Where shapes are, and how far their surfaces go round what they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from clvol.scene.primitives import QUADRICS, mesh_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    from clvol.scene import records

CLOSED, LEAKY = 1e-3, 0.1
"""Openness of shapes that are closed but for rounding, and of meshes that only have holes."""
_CHUNK = 1 << 16
_area_of: WeakKeyDictionary[records.Shape, tuple[np.ndarray, float]] = WeakKeyDictionary()


def shape_bounds(shape: records.Shape) -> tuple[np.ndarray, np.ndarray]:
    """Axis-aligned world bounds (lower, upper) of a shape, float64 (3,)."""
    linear, centre = shape.to_world[:3, :3], shape.to_world[:3, 3]
    if shape.kind == "mesh":
        return mesh_bounds(shape)
    if shape.kind == "sphere":
        extent = np.sqrt((linear**2).sum(axis=1))
    elif shape.kind == "cube":
        extent = np.abs(linear).sum(axis=1)
    elif shape.kind == "rectangle":
        extent = np.abs(linear[:, :2]).sum(axis=1)
    else:
        extent = np.sqrt((linear[:, :2] ** 2).sum(axis=1))
        if shape.kind == "cylinder":
            top = centre + linear[:, 2]
            return np.minimum(centre, top) - extent, np.maximum(centre, top) + extent
    return centre - extent, centre + extent


def mesh_bounds(shape: records.Shape) -> tuple[np.ndarray, np.ndarray]:
    """World bounds of the vertices that faces use."""
    mesh = mesh_of(shape)
    used = np.unique(mesh.faces)
    linear, offset = shape.to_world[:3, :3], shape.to_world[:3, 3]
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for start in range(0, len(used), 1 << 16):
        points = mesh.vertices[used[start : start + (1 << 16)]] @ linear.T + offset
        lower, upper = np.minimum(lower, points.min(axis=0)), np.maximum(upper, points.max(axis=0))
    return lower, upper


def bounds_of(shapes: Iterable[records.Shape]) -> tuple[np.ndarray, np.ndarray]:
    """World bounds of shapes, of which there is one at least."""
    lower, upper = zip(*map(shape_bounds, shapes), strict=True)
    return np.min(lower, axis=0), np.max(upper, axis=0)


def is_piece(shape: records.Shape) -> bool:
    """Whether it bounds nothing by itself, as a wall; a mesh that has holes does."""
    return shape.kind in ("rectangle", "disk", "cylinder") or openness([shape]) > LEAKY


def openness(shapes: Iterable[records.Shape], turned: Iterable[records.Shape] = ()) -> float:
    """Length of the sum of all area vectors over the area: 0 where surfaces are closed, 1 of a plane.

    turned : shapes whose back is the front of the others, as walls that keep out what those hold.
    """
    areas = [(1, *_area(shape)) for shape in shapes] + [(-1, *_area(shape)) for shape in turned]
    net, total = sum(sign * vector for sign, vector, _ in areas), sum(area for _, _, area in areas)
    return float(np.linalg.norm(net)) / total if total > 0 else 0.0


def _area(shape: records.Shape) -> tuple[np.ndarray, float]:
    """Area vector (3,), the sum of normals times areas, and area of a shape's surface in the world."""
    if shape not in _area_of:
        with np.errstate(over="ignore", invalid="ignore"):  # of what is refused later
            vector, area = _of_quadric(shape) if shape.kind in QUADRICS else _of_triangles(shape)
        _area_of[shape] = -vector if shape.flip_normals else vector, area
    return _area_of[shape]


def quadric_area(shape: records.Shape) -> float:
    """World area of a sphere, a disk (an ellipse where it is stretched), or a cylinder without its ends."""
    x, y, z = shape.to_world[:3, :3].T
    if shape.kind == "sphere":
        return 4 * np.pi * float(x @ x)
    if shape.kind == "disk":
        return np.pi * float(np.linalg.norm(np.cross(x, y)))
    return 2 * np.pi * float(np.linalg.norm(x) * np.linalg.norm(z))


def _of_quadric(shape: records.Shape) -> tuple[np.ndarray, float]:
    """Normals of a sphere and of an open cylinder add up to nothing."""
    x, y, z = shape.to_world[:3, :3].T
    across = np.cross(x, y)
    front = np.copysign(np.pi, across @ z) if shape.kind == "disk" else 0.0
    return front * across, quadric_area(shape)


def _of_triangles(shape: records.Shape) -> tuple[np.ndarray, float]:
    mesh, linear = mesh_of(shape), shape.to_world[:3, :3]
    vector, area = np.zeros(3), 0.0
    for start in range(0, len(mesh.faces), _CHUNK):
        a, b, c = (mesh.vertices[mesh.faces[start : start + _CHUNK, n]] @ linear.T for n in range(3))
        twice = np.cross(b - a, c - a)
        vector += twice.sum(axis=0) / 2
        area += float(np.linalg.norm(twice, axis=1).sum()) / 2
    return vector * np.copysign(1.0, np.linalg.det(linear)), area
