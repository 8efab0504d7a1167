"""PLY files as arrays, ASCII and binary.

trimesh cuts polygons into fans, reads no binary file that mixes them, and keeps one texture coordinate for a
vertex whose corners name several, so PLY files are read here.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field

import numpy as np

from clvol.scene.mesh import RawMesh
from clvol.scene.obj import parse_numbers
from clvol.scene.polygons import distinct, triangulate

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"}
_FORMATS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
_UVS = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
_INDICES = ("vertex_indices", "vertex_index")
_CORNER_UVS = "texcoord"
_ENDINGS = "01234xyzwrgba"
_NO_INDEX = 2**62
"""What indices beyond any table become."""


@dataclass
class _Element:
    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)  # name, type, type of a list's count


_Property = tuple[str, np.dtype, np.dtype | None]
"""Name, type and, of a list, the type of its count."""


@dataclass(frozen=True)
class _Lists:
    """The rows of a list property: all values in a row, and how many each row has."""

    values: np.ndarray
    sizes: np.ndarray


_Columns = dict[str, np.ndarray | _Lists]
"""The properties of an element, each of all rows."""


def read_ply(data: bytes) -> RawMesh:
    """Positions, faces (polygons as triangles), normals, texture coordinates and attributes of a PLY file.

    Texture coordinates may be the vertices' (u, v; s, t; texture_u, texture_v) or the corners' (texcoord).

    Raises
    ------
    ValueError
        No PLY, one without vertices or faces, or a file that ends too early.
    """
    form, elements, body = _header(data)
    if form == "=":
        body, elements = _as_binary(body, elements)
    found: dict[str, _Columns] = {}
    place = 0
    for element in elements:
        found[element.name], place = _rows(body, place, element, form)
        if {"vertex", "face"} <= set(found):
            break
    vertices = found.get("vertex", {})
    positions = _columns(vertices, ("x", "y", "z"))
    if positions is None:
        raise ValueError("vertices without x, y and z")
    faces = found.get("face", {})
    polygons = next((p for name in _INDICES if isinstance(p := faces.get(name), _Lists)), None)
    if polygons is None or not len(polygons.sizes):
        raise ValueError("it has no triangles")
    uvs = next((uv for names in _UVS if (uv := _columns(vertices, names)) is not None), None)
    normals = _columns(vertices, ("nx", "ny", "nz"))
    of_vertices, of_faces = attributes_of(vertices, "vertex"), attributes_of(faces, "face")
    return _assemble(positions, normals, uvs, polygons, faces.get(_CORNER_UVS), of_vertices, of_faces)


def _assemble(
    positions: np.ndarray,
    normals: np.ndarray | None,
    uvs: np.ndarray | None,
    polygons: _Lists,
    corner_uvs: np.ndarray | _Lists | None,
    of_vertices: dict[str, np.ndarray],
    of_faces: dict[str, np.ndarray],
) -> RawMesh:
    sizes, corners = polygons.sizes, polygons.values
    if corners.dtype.kind == "f":
        corners = np.clip(np.nan_to_num(corners, nan=_NO_INDEX), -_NO_INDEX, _NO_INDEX)
    corners = corners.astype(np.int64)
    if (sizes < 3).any():
        raise ValueError("a face of fewer than three corners")
    wrong = (corners < 0) | (corners >= len(positions))
    if wrong.any():
        raise ValueError(f"a triangle names vertex {corners[wrong.argmax()]} of {len(positions)}")
    triangles = triangulate(positions[corners] if (sizes > 3).any() else positions[:0], sizes)
    polygon = np.repeat(np.arange(len(sizes)), sizes)[triangles[:, 0]] if of_faces else None
    of_faces = {name: values[polygon] for name, values in of_faces.items()}
    if uvs is not None or not isinstance(corner_uvs, _Lists):
        return RawMesh(positions, corners[triangles], normals, uvs, attributes=of_vertices | of_faces)
    named = corner_uvs.sizes == 2 * sizes
    if not (named | (corner_uvs.sizes == 0)).all():
        raise ValueError(f"a face whose {_CORNER_UVS} are not two numbers a corner")
    has = np.repeat(named, sizes)
    of_corners = np.zeros((len(corners), 2))
    of_corners[has] = corner_uvs.values.reshape(-1, 2)
    known, number = np.unique(of_corners[has], axis=0, return_inverse=True)
    which = np.full(len(corners), len(known))
    which[has] = number.reshape(-1)
    first, vertex = distinct([corners, which])
    used = corners[first]
    return RawMesh(
        positions[used],
        vertex[triangles],
        None if normals is None else normals[used],
        of_corners[first] if named.any() else None,
        ~has[first] if named.any() and not named.all() else None,
        {name: values[used] for name, values in of_vertices.items()} | of_faces,
    )


def attributes_of(rows: _Columns, kind: str) -> dict[str, np.ndarray]:
    """What else the rows of vertices or faces hold, as Mitsuba names it: numbers (n, 1) or (n, 3) each.

    red, green and blue, or r, g and b, are vertex_color; what ends in _0, _1 and _2 or in _x, _y and _z has
    the name before, and what ends in _r, _g and _b has "_color" after it.  One number may stand alone.
    """
    found: dict[str, list[str]] = {}
    for names in (("red", "green", "blue"), ("r", "g", "b")):
        if all(isinstance(rows.get(name), np.ndarray) for name in names):
            found[f"{kind}_color"] = list(names)
    for name, column in rows.items():
        before, _, after = name.rpartition("_")
        if before and len(after) == 1 and after in _ENDINGS and isinstance(column, np.ndarray):
            key = f"{kind}_{before}" + ("_color" if after in "rgba" else "")
            found.setdefault(key, []).append(name)
    kept = {key: names for key, names in found.items() if len(names) in (1, 3)}
    columns = {key: _columns(rows, tuple(names)) for key, names in kept.items()}
    return {key: values for key, values in columns.items() if values is not None}


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Byte order ("=": ASCII), elements and what follows the header."""
    end = re.search(rb"\nend_header[ \t]*\r?\n", data)
    lines = data[: end.start()].decode("ascii", "replace").splitlines() if end else []
    form, elements = "", []
    for words in (line.split() for line in lines):
        match words:
            case ["format", name, _]:
                form = _FORMATS.get(name, "")
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", count, kind, name] if elements:
                elements[-1].properties.append((name, _type(kind), _type(count)))
            case ["property", kind, name] if elements:
                elements[-1].properties.append((name, _type(kind), ""))
    if not end or not form or not lines[0].startswith("ply"):
        raise ValueError("it has no header of a ply")
    return form, elements, data[end.end() :]


def _type(name: str) -> str:
    if name not in _TYPES:
        raise ValueError(f"a property of type '{name[:40]}'")
    return _TYPES[name]


def _as_binary(body: bytes, elements: list[_Element]) -> tuple[bytes, list[_Element]]:
    """The numbers of an ASCII file as a binary one of doubles."""
    numbers = parse_numbers(body, np.float64)
    if numbers is None:
        raise ValueError("something other than numbers among its rows")
    doubles = [
        _Element(e.name, e.count, [(name, "f8", counted and "f8") for name, _, counted in e.properties])
        for e in elements
    ]
    return numbers.tobytes(), doubles


def _columns(rows: _Columns, names: tuple[str, ...]) -> np.ndarray | None:
    """Properties `names` side by side, float64; None where one is missing."""
    columns = [column for name in names if isinstance(column := rows.get(name), np.ndarray)]
    if len(columns) < len(names):
        return None
    return np.stack([column.astype(np.float64) for column in columns], axis=1)


def _rows(body: bytes, place: int, element: _Element, form: str) -> tuple[_Columns, int]:
    """The properties of all rows of an element that begins at byte `place`, and where it ends."""
    properties = [
        (n, np.dtype(form + k), np.dtype(form + c) if c else None) for n, k, c in element.properties
    ]
    if not element.count or not properties:
        return {}, place
    sizes = [counts[0] for counts, _ in _walk(body, place, properties, 1, element.name)[0]]
    fields: list[tuple[str, np.dtype] | tuple[str, np.dtype, tuple[int]]] = []
    for n, ((_, kind, counted), size) in enumerate(zip(properties, sizes, strict=True)):
        fields += [(f"count {n}", counted)] if counted else []
        fields.append((f"{n}", kind, (size,)))
    row = np.dtype(fields)
    if row.itemsize * element.count > len(body) - place:
        return _uneven_rows(body, place, element, properties)
    table = np.frombuffer(body, row, element.count, place)
    found: _Columns = {}
    for n, ((name, _, counted), size) in enumerate(zip(properties, sizes, strict=True)):
        values = table[f"{n}"]
        if not counted:
            found[name] = values[:, 0]
        elif (table[f"count {n}"] == size).all():
            found[name] = _Lists(values.reshape(-1), np.full(element.count, size, np.int64))
        else:
            return _uneven_rows(body, place, element, properties)
    return found, place + row.itemsize * element.count


def _uneven_rows(
    body: bytes, place: int, element: _Element, properties: list[_Property]
) -> tuple[_Columns, int]:
    """`_rows` where lists are not all as long as in the first row."""
    columns, end = _walk(body, place, properties, element.count, element.name)
    found: _Columns = {}
    for (name, kind, counted), (sizes, parts) in zip(properties, columns, strict=True):
        values = np.frombuffer(b"".join(parts), kind)
        found[name] = _Lists(values, np.array(sizes, np.int64)) if counted else values
    return found, end


def _walk(
    body: bytes, place: int, properties: list[_Property], rows: int, name: str
) -> tuple[list[tuple[list[int], list[bytes]]], int]:
    """How many values each property has in each row, and their bytes; and where the rows end."""
    columns: list[tuple[list[int], list[bytes]]] = [([], []) for _ in properties]
    steps = []
    for (_, kind, counted), (sizes, parts) in zip(properties, columns, strict=True):
        count = counted and struct.Struct((">" if counted.str[0] == ">" else "<") + counted.char)
        steps.append((sizes.append, parts.append, kind.itemsize, count))
    rows_of = {"vertex": "vertices", "face": "faces"}.get(name, f"rows of {name[:40]}")
    for _ in range(rows):
        for add_size, add_part, width, count in steps:
            size = 1
            if count:
                if place + count.size > len(body):
                    raise ValueError(f"the file ends within its {rows_of}")
                (size,) = count.unpack_from(body, place)
                place += count.size
                if not 0 <= size <= len(body):
                    raise ValueError(f"a list of {size} values among its {rows_of}")
            end = place + int(size) * width
            if end > len(body):
                raise ValueError(f"the file ends within its {rows_of}")
            add_size(int(size))
            add_part(body[place:end])
            place = end
    return columns, place
