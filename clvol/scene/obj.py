"""Wavefront OBJ as arrays.

A corner of a face names a position, a texture coordinate and a normal each by an index of its own, so that
a hard edge is one position with two normals.  trimesh keeps one of them, so OBJ files are read here.
"""

from __future__ import annotations

import codecs
import warnings

import numpy as np

from clvol.scene.mesh import RawMesh
from clvol.scene.polygons import distinct, triangulate

_NONE = -1


def read_obj(data: bytes) -> RawMesh:
    """Positions, faces (polygons as triangles), normals and texture coordinates of an OBJ file.

    Groups, materials, smoothing groups, lines and points are skipped.  A vertex is one combination of the
    three indices, as in Mitsuba.  Where some corners name a normal, those that do not get their face's.

    Raises
    ------
    ValueError
        Numbers or indices that cannot be understood, or that point nowhere.
    """
    tables: dict[bytes, list[bytes]] = {b"v": [], b"vt": [], b"vn": []}
    faces: list[bytes] = []
    counts: list[tuple[int, ...]] = []  # rows of each table so far, which negative indices count back from
    data = data.removeprefix(codecs.BOM_UTF8)
    for line in data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        keyword, rest = (*line.split(None, 1), b"", b"")[:2]
        if keyword in tables:
            tables[keyword].append(rest)
        elif keyword == b"f":
            faces.append(rest.partition(b"#")[0])
            counts.append(tuple(len(rows) for rows in tables.values()))
    if not faces:
        raise ValueError("it has no triangles")
    positions, uvs, normals = (_numbers(rows, 2 if key == b"vt" else 3) for key, rows in tables.items())
    corners, sizes = _corners(faces)
    before = np.repeat(np.array(counts, np.int64).reshape(-1, 3), sizes, axis=0)
    corners = np.where(corners > 0, corners - 1, np.where(corners < 0, before + corners, _NONE))
    return _assemble(corners, sizes, positions, uvs, normals)


def _numbers(rows: list[bytes], width: int) -> np.ndarray:
    """The first `width` numbers of each row, float64 (n, width); all rows hold equally many."""
    if not rows:
        return np.zeros((0, width))
    values = parse_numbers(b" ".join(rows), np.float64)
    held = len(rows[0].partition(b"#")[0].split())
    if held >= width and values is not None and values.size == held * len(rows):
        return values.reshape(len(rows), held)[:, :width]
    table = np.zeros((len(rows), width))  # rows of different lengths, or comments among them
    for at, row in zip(table, rows, strict=True):
        numbers = [float(number) for number in row.partition(b"#")[0].split()[:width]]
        if len(numbers) < (1 if width == 2 else width):
            raise ValueError(f"expected {width} numbers, got '{row[:40].decode('latin-1')}'")
        at[: len(numbers)] = numbers
    return table


def _corners(faces: list[bytes]) -> tuple[np.ndarray, np.ndarray]:
    """Indices (v, vt, vn) of every corner as written, 0 if left out, int64 (n, 3); corners per face (m,)."""
    sizes = np.fromiter((len(face.split()) for face in faces), np.int64, len(faces))
    if (sizes < 3).any():
        raise ValueError("a face of fewer than three corners")
    text = b" ".join(faces)
    letters = np.frombuffer(text, np.uint8)
    blank = np.concatenate([[True], letters <= ord(" ")])
    slashes = np.add.reduceat(letters == ord("/"), np.flatnonzero(blank[:-1] & ~blank[1:]), dtype=np.int64)
    width = int(slashes[0]) + 1
    if width <= 3 and (slashes == slashes[0]).all():
        numbers = parse_numbers(text.replace(b"//", b"/0/").replace(b"/", b" "), np.int64)
        if numbers is not None and numbers.size == width * len(slashes):
            corners = np.zeros((len(slashes), 3), np.int64)
            corners[:, :width] = numbers.reshape(-1, width)
            return corners, sizes
    rows = []
    for corner in text.split():  # corners that name different things
        indices = [int(index) if index else 0 for index in corner.split(b"/")]
        if len(indices) > 3:
            raise ValueError(f"a corner '{corner[:40].decode('latin-1')}'")
        rows.append(indices + [0] * (3 - len(indices)))
    return np.array(rows, np.int64).reshape(-1, 3), sizes


def parse_numbers(text: bytes, dtype: type) -> np.ndarray | None:
    """Numbers apart by blanks; None where something else is among them."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, dtype, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _assemble(
    corners: np.ndarray, sizes: np.ndarray, positions: np.ndarray, uvs: np.ndarray, normals: np.ndarray
) -> RawMesh:
    """Vertices from the corners' combinations of indices, in the order of first use; triangles."""
    tables = {"position": positions, "texture coordinate": uvs, "normal": normals}
    for n, (name, table) in enumerate(tables.items()):
        wrong = (corners[:, n] >= len(table)) | (corners[:, n] < (0 if n == 0 else _NONE))
        if wrong.any():
            raise ValueError(f"a face names {name} {corners[wrong.argmax(), n] + 1} of {len(table)}")
    without = corners == _NONE
    has_uvs, has_normals = (~without[:, 1:].all(axis=0)).tolist()
    columns = [corners[:, 0]]
    if has_uvs:
        columns.append(corners[:, 1] + 1)
    if has_normals:
        face = np.repeat(np.arange(len(sizes)), sizes)  # a vertex of one face has that face's normal
        columns.append(np.where(without[:, 2], len(normals) + face, corners[:, 2]))
    first, vertex = distinct(columns)
    used = corners[first]
    return RawMesh(
        positions[used[:, 0]],
        vertex[triangulate(positions[corners[:, 0]], sizes)],
        _rows(normals, used[:, 2]) if has_normals else None,
        _rows(uvs, used[:, 1]) if has_uvs else None,
        without[first, 1] if has_uvs and without[:, 1].any() else None,
    )


def _rows(table: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Rows of a table, 0 where an index names none."""
    return np.where((indices == _NONE)[:, None], 0.0, table[np.maximum(indices, 0)])
