"""Binary PLY files that mix triangles with other polygons: trimesh reads none, and Blender writes them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from clvol.scene.mesh import RawMesh, triangle_fans

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)  # name, type, type of a list's count


def read_mixed_ply(data: bytes) -> RawMesh:
    """The triangles of a binary PLY whose first two elements are its vertices and its faces.

    Raises
    ------
    ValueError
        Anything else, or a file that ends too early.
    """
    order, elements, body = _header(data)
    if [element.name for element in elements[:2]] != ["vertex", "face"]:
        raise ValueError("a ply of other elements than vertices and faces")
    vertex, face = elements[:2]
    if any(counted for *_, counted in vertex.properties):
        raise ValueError("a ply with lists among its vertices")
    row = np.dtype([(name, order + kind) for name, kind, _ in vertex.properties])
    vertices = np.frombuffer(body, row, vertex.count)
    indices, sizes = _polygons(body[vertex.count * row.itemsize :], face, order)
    positions, normals = (_columns(vertices, names) for names in (("x", "y", "z"), ("nx", "ny", "nz")))
    if positions is None:
        raise ValueError("vertices without x, y and z")
    uvs = [_columns(vertices, names) for names in (("u", "v"), ("s", "t"))]
    found = next((uv for uv in uvs if uv is not None), None)
    return RawMesh(positions, triangle_fans(indices, sizes), normals, found)


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Byte order, elements and what follows the header."""
    end = re.search(rb"\nend_header\r?\n", data)
    lines = data[: end.start()].decode("ascii", "replace").splitlines() if end else []
    order, elements = "", []
    for words in (line.split() for line in lines):
        match words:
            case ["format", name, _]:
                order = _ORDERS.get(name, "")
            case ["element", name, count] if count.isdigit():
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, kind, name] if elements:
                elements[-1].properties.append((name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements:
                elements[-1].properties.append((name, _TYPES[kind], ""))
    if not order:
        raise ValueError("no binary ply")
    return order, elements, data[end.end() :]


def _columns(rows: np.ndarray, names: tuple[str, ...]) -> np.ndarray | None:
    """Properties `names` side by side, float64; None where one is missing."""
    if not set(names) <= set(rows.dtype.names):
        return None
    return np.stack([rows[name].astype(np.float64) for name in names], axis=1)


def _polygons(body: bytes, face: _Element, order: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of all faces in a row, int64, and how many each has."""
    lists = [n for n, (*_, counted) in enumerate(face.properties) if counted]
    if len(lists) != 1:
        raise ValueError("faces of one list of vertices are needed")
    at = lists[0]
    _, kind, counted = face.properties[at]
    skipped = [
        sum(np.dtype(k).itemsize for _, k, _ in part)
        for part in (face.properties[:at], face.properties[at + 1 :])
    ]
    index, length = np.dtype(order + kind), np.dtype(counted).itemsize
    byte_order = "little" if order == "<" else "big"
    place, sizes, parts = 0, [], []
    for _ in range(face.count):
        first = place + skipped[0] + length
        size = int.from_bytes(body[first - length : first], byte_order)
        place = first + size * index.itemsize + skipped[1]
        if place > len(body) or size < 3:
            raise ValueError(
                "the file ends within its faces" if size > 2 else "a face of fewer than three corners"
            )
        sizes.append(size)
        parts.append(body[first : first + size * index.itemsize])
    return np.frombuffer(b"".join(parts), index).astype(np.int64), np.array(sizes, np.int64)
