"""Our `mesh` plugin: triangles that are arrays, by the names that Mitsuba's meshes have for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.base.masks import masked_count
from clvol.scene.mesh import RawMesh, build_mesh
from clvol.scene.mesh_attributes import PREFIXES
from clvol.scene.nodes import Node

if TYPE_CHECKING:
    from clvol.scene.reader import Reader
    from clvol.scene.records import Mesh

_ROWS = {"vertex_positions": 3, "faces": 3, "vertex_normals": 3, "vertex_texcoords": 2}
"""Parameters of Mitsuba's meshes by the names of `mi.traverse`, and the length of their rows."""


def read_arrays(reader: Reader) -> tuple[Mesh, np.ndarray]:
    """The mesh of a `mesh` plugin, and the point (float64 (3,)) that its vertices are relative to.

    Its parameters are those that ``mi.traverse`` shows of a mesh, as rows or one after another:
    `vertex_positions`, `faces`, `vertex_normals`, `vertex_texcoords`, and attributes by their names.
    """
    for name in ("vertex_positions", "faces"):
        if not reader.has(name):
            reader.fail(f"a mesh needs {name}", hint="an array (n, 3); a file is read by ply and others")
    arrays = {name: _array(reader, name, width) for name, width in _ROWS.items() if reader.has(name)}
    given = {name: array for name, array in arrays.items() if len(array)}
    vertices, faces = (given.get(name, np.zeros((0, 3))) for name in ("vertex_positions", "faces"))
    if faces.dtype.kind not in "iu":
        whole = np.rint(faces)
        if not (whole == faces).all():
            reader.fail("'faces' must be whole numbers: the numbers of vertices", "faces")
        faces = whole
    with np.errstate(invalid="ignore"):
        faces = np.clip(faces, -1, 2**31).astype(np.int64)
    attributes = {}
    for name, value in list(reader.node.parameters()):
        other = name in _ROWS or name == "face_normals" or isinstance(value, Node)
        if name.startswith(PREFIXES) and not other:
            reader.has(name)
            attributes[name] = _array(reader, name, 0, len(faces if name.startswith("face_") else vertices))
    for name in ("vertex_normals", "vertex_texcoords"):
        if name in given and len(given[name]) != len(vertices):
            reader.fail(f"'{name}' has {len(given[name])} rows, there are {len(vertices)} vertices", name)
    face_normals = reader.boolean("face_normals", False)
    normals, uvs = given.get("vertex_normals"), given.get("vertex_texcoords")
    raw = RawMesh(vertices, faces, normals, uvs, attributes=attributes)
    try:
        return build_mesh(raw, reader.node.id or "mesh", smooth=not face_normals)
    except ValueError as error:
        reader.fail(f"mesh: {error}", "faces" if "triangle" in str(error) else "vertex_positions")


def _array(reader: Reader, name: str, width: int, rows: int | None = None) -> np.ndarray:
    """An array of rows of `width` numbers, or of 1 or 3 for each of `rows`."""
    array = reader.array(name)
    if masked_count(array):
        reader.fail(f"'{name}' has {masked_count(array)} masked values, a mesh needs them all", name)
    array = np.ma.getdata(array)
    if rows is not None and array.size in (rows, 3 * rows) and rows:
        width = array.size // rows
    elif rows is not None:
        reader.fail(f"'{name}' has {array.size} numbers, not 1 or 3 for each of {rows}", name)
    if array.size % width or (array.ndim > 1 and array.shape[-1] not in (width, array.size)):
        reader.fail(f"'{name}' must be rows of {width} numbers, got shape {array.shape}", name)
    return array.reshape(-1, width)
