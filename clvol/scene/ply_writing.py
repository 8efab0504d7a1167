"""Meshes as PLY files, which `read_ply` and Mitsuba read: binary, little-endian, in single precision."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from clvol.scene.records import Mesh

_NAMES = ("x", "y", "z"), ("nx", "ny", "nz"), ("u", "v")


def encode_ply(mesh: Mesh) -> bytes:
    """A mesh's vertices, with their normals and texture coordinates if it has such, and its triangles."""
    given = [
        (names, values)
        for names, values in zip(_NAMES, (mesh.vertices, mesh.normals, mesh.uvs), strict=True)
        if values is not None
    ]
    columns = [name for names, _ in given for name in names]
    vertices = np.hstack([values for _, values in given]).astype("<f4")
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in columns),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
        "",
    ]
    return "\n".join(header).encode("ascii") + vertices.tobytes() + faces.tobytes()
