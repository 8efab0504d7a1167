"""Mitsuba's `.serialized` meshes: several in a file, each deflated on its own; offsets at its end."""

from __future__ import annotations

import logging
import os
import struct
import zlib
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from clvol.base.memory import available_memory, format_bytes
from clvol.scene.mesh import RawMesh

if TYPE_CHECKING:
    from pathlib import Path

log = logging.getLogger("clvol")

_IDENTIFIER = 0x041C
_OFFSETS = {3: "<u4", 4: "<u8"}
"""Of each version, how it writes where meshes begin."""
_NORMALS, _UVS, _COLORS, _FACE_NORMALS, _DOUBLE = 0x1, 0x2, 0x8, 0x10, 0x2000
_LONGEST_NAME = 4096
_MOST_RATIO = 1032
"""Of deflated bytes to their code: a mesh that claims more is a bomb or damaged."""
_MOST_BYTES = 4 << 30
_COPIES = 4
"""How many times a mesh's bytes are taken, with what is worked out from them."""
_CHUNK = 1 << 16


def read_serialized(path: Path, shape_index: int) -> RawMesh:
    """Mesh `shape_index`, from 0, of a file of version 3 or 4.

    Its name, the colours of vertices and a request for faces' normals are passed over, as by Mitsuba.

    Raises
    ------
    ValueError
        Another file or version, no such mesh, one that ends too early or claims what its bytes cannot hold.
    """
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        version = _version(file)
        offset = _offset(file, size, version, shape_index) if shape_index else 0
        file.seek(offset)
        _version(file)
        stream = _Inflated(file, size - file.tell())
        (flags,) = struct.unpack("<I", stream.read(4, "header"))
        if version == 4:
            _skip_name(stream)
        vertices, triangles = struct.unpack("<QQ", stream.read(16, "header"))
        kind = np.dtype("<f8" if flags & _DOUBLE else "<f4")
        widths = 3 + 3 * bool(flags & _NORMALS) + 2 * bool(flags & _UVS) + 3 * bool(flags & _COLORS)
        _check_size(vertices, triangles, vertices * widths * kind.itemsize + 12 * triangles, stream.length)
        positions = stream.array(vertices, 3, kind, "vertices")
        normals = stream.array(vertices, 3, kind, "normals") if flags & _NORMALS else None
        uvs = stream.array(vertices, 2, kind, "texture coordinates") if flags & _UVS else None
        if flags & _COLORS:
            stream.skip(vertices * 3 * kind.itemsize, "colours")
        faces = stream.array(triangles, 3, np.dtype("<u4"), "triangles")
        stream.check_end()
    if flags & _FACE_NORMALS:
        log.warning("%s: it asks for faces' normals, which Mitsuba does not heed: set face_normals", path)
    return RawMesh(positions, faces, normals, uvs)


def _version(file: BinaryIO) -> int:
    identifier, version = struct.unpack("<HH", file.read(4).ljust(4, b"\0"))
    if identifier != _IDENTIFIER:
        raise ValueError(f"no mesh begins at byte {file.tell() - 4}" if file.tell() > 4 else "it holds none")
    if version not in _OFFSETS:
        raise ValueError(f"it is of version {version}; 3 and 4 can be read")
    return int(version)


def _offset(file: BinaryIO, size: int, version: int, index: int) -> int:
    """The byte where a mesh begins, from the table at the end of the file."""
    kind = np.dtype(_OFFSETS[version])
    file.seek(max(size - 4, 0))
    (count,) = struct.unpack("<I", file.read(4).ljust(4, b"\0"))
    table = size - 4 - count * kind.itemsize
    if not count or table < 4:
        raise ValueError(f"its table of meshes is damaged: {count} meshes in {size} bytes")
    if index >= count:
        raise ValueError(f"there is no shape_index {index}: it holds {count}, numbered from 0")
    file.seek(table + index * kind.itemsize)
    offset = int.from_bytes(file.read(kind.itemsize), "little")
    if offset > table - 4:
        raise ValueError(f"its table of meshes is damaged: mesh {index} at byte {offset} of {size}")
    return offset


def _skip_name(stream: _Inflated) -> None:
    for _ in range(_LONGEST_NAME):
        if stream.read(1, "name") == b"\0":
            return
    raise ValueError(f"its name has more than {_LONGEST_NAME} bytes")


def _check_size(vertices: int, triangles: int, wanted: int, held: int) -> None:
    claim = f"it claims {vertices} vertices and {triangles} triangles"
    if wanted > _MOST_RATIO * held:
        raise ValueError(f"{claim}, which its {held} bytes cannot hold")
    free = available_memory()
    if wanted > _MOST_BYTES or (free is not None and _COPIES * wanted > free):
        raise ValueError(f"{claim}, {format_bytes(wanted)}: too many")


class _Inflated:
    """The inflated bytes of a file from where it stands; no more of them at a time than asked for."""

    def __init__(self, file: BinaryIO, length: int) -> None:
        self.length = length
        self._file, self._zlib, self._left = file, zlib.decompressobj(), b""

    def _some(self, most: int) -> bytes:
        """Between 1 and `most` bytes; none at the end."""
        while not self._zlib.eof:
            code = self._left or self._file.read(_CHUNK)
            try:
                found = self._zlib.decompress(code, most)
            except zlib.error:
                raise ValueError("its deflated data is damaged") from None
            self._left = self._zlib.unconsumed_tail
            if found or not code:
                return found
        return b""

    def fill(self, target: memoryview, what: str) -> None:
        """Fill `target` with what comes next."""
        filled = 0
        while filled < len(target):
            part = self._some(min(_CHUNK, len(target) - filled))
            if not part:
                raise ValueError(f"it ends within its {what}")
            target[filled : filled + len(part)] = part
            filled += len(part)

    def read(self, count: int, what: str) -> bytes:
        """The next `count` bytes, few."""
        found = bytearray(count)
        self.fill(memoryview(found), what)
        return bytes(found)

    def array(self, rows: int, width: int, kind: np.dtype, what: str) -> np.ndarray:
        """The next numbers, (rows, width)."""
        found = np.empty((rows, width), kind)
        if found.size:
            self.fill(found.reshape(-1).data.cast("B"), what)
        return found

    def skip(self, count: int, what: str) -> None:
        """Pass over `count` bytes."""
        buffer = memoryview(bytearray(min(count, _CHUNK)))
        for first in range(0, count, _CHUNK):
            self.fill(buffer[: count - first], what)

    def check_end(self) -> None:
        """Read on to the check sum, if it comes next."""
        self._some(1)
