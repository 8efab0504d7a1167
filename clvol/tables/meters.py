"""The shape that a meter measures all over, as the device draws points of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.errors import SceneError
from clvol.scene.primitives import QUADRICS, mesh_of

if TYPE_CHECKING:
    from clvol.scene.records import Shape


def meter_faces(shape: Shape, centre: np.ndarray) -> np.ndarray:
    """METER_FACE records of a shape, relative to `centre`: one of a quadric, else one for each triangle.

    Raises
    ------
    SceneError
        It has no area.
    """
    side = -1.0 if shape.flip_normals else 1.0
    linear, origin = shape.to_world[:3, :3], shape.to_world[:3, 3] - centre
    if shape.kind in QUADRICS:
        face = np.zeros(1, layout.METER_FACE)
        face["kind"], face["count"] = layout.enum("METER", shape.kind), 1
        face["cdf"], face["side"], face["place"] = 1.0, side, origin
        face["x"], face["y"], face["z"] = linear.T
        if shape.kind == "disk":
            face["z"] = side * np.linalg.inv(linear)[2] / np.linalg.norm(np.linalg.inv(linear)[2])
        return face
    mesh = mesh_of(shape)
    corners = (mesh.vertices.astype(np.float64) @ linear.T + origin)[mesh.faces]
    edges = corners[:, 1:] - corners[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1]) * side * np.sign(np.linalg.det(linear))
    areas = np.linalg.norm(normals, axis=1)
    some = areas > 0
    if not some.any():
        raise SceneError("a meter is on a shape without any area", shape.name or shape.kind)
    faces = np.zeros(int(some.sum()), layout.METER_FACE)
    faces["kind"], faces["count"] = layout.enum("METER", "triangle"), len(faces)
    faces["cdf"] = np.cumsum(areas[some]) / areas[some].sum()
    faces["cdf"][-1] = 1.0
    faces["place"], faces["x"], faces["y"] = corners[some, 0], edges[some, 0], edges[some, 1]
    faces["z"] = normals[some] / areas[some, None]
    return faces
