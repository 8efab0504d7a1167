"""Writes small OpenVDB files (version 224) for tests, by OpenVDB's own rules and independently of the reader.

Everything the format allows can be asked for: each transform, value type, half, compression, tiles at each
level, several grids, instances.  The way inactive values are stored follows from the values, as in OpenVDB.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import blosc
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

MAGIC = 0x56444220
ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4
LETTERS = {"float": "f", "double": "d", "half": "e", "int32": "i", "int64": "q", "vec3s": "f", "vec3d": "d"}
UNIT_SCALE = ("UniformScaleMap", [1.0] * 15)


@dataclass
class GridSpec:
    """One grid of a file.

    leaves : origin (x, y, z) -> (values (8, 8, 8) indexed [x, y, z], active bool (8, 8, 8)); of vectors
        values are (8, 8, 8, 3), and background and tiles have three.
    tiles : (origin, edge 8 | 128 | 4096, value, active).
    transform : name of the map and the doubles it stores.
    grid_type : overrides the type's name.  parent : unique name of the grid whose tree is shared.
    """

    name: str = "density"
    suffix: str = ""
    value_type: str = "float"
    half: bool = False
    compression: int = 0
    background: float = 0
    leaves: dict = field(default_factory=dict)
    tiles: list = field(default_factory=list)
    transform: tuple[str, Sequence[float]] = UNIT_SCALE
    metadata: list[tuple[str, str, bytes]] = field(default_factory=list)
    grid_type: str = ""
    parent: str = ""

    @property
    def letter(self) -> str:
        """Struct letter of a value at full width."""
        return LETTERS[self.value_type]

    @property
    def halved(self) -> bool:
        """Values are stored as halves, which whole numbers never are, whatever the grid says."""
        return self.half and self.letter in "fd"

    @property
    def all_metadata(self) -> list[tuple[str, str, bytes]]:
        """The grid's metadata, with that by which OpenVDB knows whether values are halves."""
        return [*self.metadata, ("is_saved_as_half_float", "bool", b"\x01")] if self.half else self.metadata

    @property
    def type_name(self) -> str:
        """Grid type as the file names it."""
        return self.grid_type or f"Tree_{self.value_type}_5_4_3" + "_HalfFloat" * self.half


def write_vdb(path, grids: Sequence[GridSpec], version: int = 224, has_offsets: bool = True) -> bytes:
    """Write the grids to `path` in their order; returns the bytes of the file."""
    out = bytearray(struct.pack("<qIIIB", MAGIC, version, 10, 0, has_offsets))
    out += b"0" * 36 + _metadata([("creator", "string", b"clvol tests")])
    out += struct.pack("<i", len(grids))
    for grid in grids:
        unique = grid.name + (f"\x1e{grid.suffix}" if grid.suffix else "")
        out += _string(unique) + _string(grid.type_name) + _string(grid.parent)
        offsets = len(out)
        out += bytes(24)
        start = len(out)
        kind, doubles = grid.transform
        out += struct.pack("<I", grid.compression) + _metadata(grid.all_metadata)
        out += _string(kind) + struct.pack(f"<{len(doubles)}d", *doubles)
        topology, buffers = (b"", b"") if grid.parent else _tree(grid)
        out += topology
        block = len(out)
        out += buffers
        out[offsets:start] = struct.pack("<3q", start, block, len(out))
    path.write_bytes(out)
    return bytes(out)


def inactive_code(inactive: np.ndarray, background: np.ndarray) -> tuple[int, list]:
    """How OpenVDB stores these inactive values: code 0–6, and the values that are written."""
    if background.ndim:
        values = sorted(set(map(tuple, inactive.tolist())))
        background, minus = tuple(background.tolist()), tuple((-background).tolist())
    else:
        values, background, minus = sorted(set(inactive.tolist())), background.item(), -background.item()
    if set(values) <= {background}:
        return 0, []
    if values == [minus]:
        return 1, []
    if len(values) == 1:
        return 2, values
    if set(values) == {background, minus}:
        return 3, []
    if len(values) == 2 and background in values:
        return 4, [v for v in values if v != background]
    return (5, values) if len(values) == 2 else (6, [])


def _string(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _metadata(entries: Sequence[tuple[str, str, bytes]]) -> bytes:
    packed = [_string(name) + _string(kind) + struct.pack("<I", len(v)) + v for name, kind, v in entries]
    return struct.pack("<i", len(entries)) + b"".join(packed)


def _mask(bits: np.ndarray) -> bytes:
    return np.packbits(bits.reshape(-1), bitorder="little").tobytes()


def _block(values: np.ndarray, grid: GridSpec) -> bytes:
    if grid.halved and not values.size:
        return b""
    raw = values.astype("<f2" if grid.halved else "<" + grid.letter).tobytes()
    if grid.compression & BLOSC:
        packed = blosc.compress(raw, typesize=2 if grid.halved else 4, cname="lz4")
    elif grid.compression & ZIP:
        packed = zlib.compress(raw)
    else:
        return raw
    return (
        struct.pack("<q", len(packed)) + packed
        if len(packed) < len(raw)
        else struct.pack("<q", -len(raw)) + raw
    )


def _values(values: np.ndarray, active: np.ndarray, grid: GridSpec) -> bytes:
    """A node's values as io::writeCompressedValues writes them."""
    if not grid.compression & ACTIVE_MASK:
        return b"\x06" + _block(values.reshape(-1), grid)
    values = values.astype("<" + grid.letter)
    background = np.array(grid.background, values.dtype)
    code, written = inactive_code(values[~active], background)
    out = bytes([code]) + np.array(written, values.dtype).tobytes()
    if code in (3, 4, 5):
        same = values == np.array(written[1] if code == 5 else background)
        out += _mask(~active & (same.all(axis=-1) if background.ndim else same))
    return out + _block(values.reshape(-1) if code == 6 else values[active], grid)


def _tree(grid: GridSpec) -> tuple[bytes, bytes]:
    """Topology, and the leaves' buffers."""
    inner = [tile for tile in grid.tiles if tile[1] < 4096]
    root_tiles = [tile for tile in grid.tiles if tile[1] == 4096]
    children = sorted({_floor(o, 4096) for o in [*grid.leaves, *(tile[0] for tile in inner)]})
    letter = "<" + grid.letter
    out = struct.pack("<i", 1) + np.array(grid.background, letter).tobytes()
    out += struct.pack("<II", len(root_tiles), len(children))
    for origin, _, value, active in root_tiles:
        out += struct.pack("<3i", *origin) + np.array(value, letter).tobytes() + bytes([active])
    buffers = b""
    for child in children:
        nodes, leaves = _node(grid, child, 4096)
        out, buffers = out + struct.pack("<3i", *child) + nodes, buffers + leaves
    return out, buffers


def _node(grid: GridSpec, origin: tuple[int, ...], edge: int) -> tuple[bytes, bytes]:
    """An internal node of `edge` samples (4096 or 128): its topology and the buffers below it."""
    cell = 128 if edge == 4096 else 8
    count = edge // cell
    values = np.full((count,) * 3 + np.shape(grid.background), grid.background, np.float64)
    active, child = np.zeros((count,) * 3, bool), np.zeros((count,) * 3, bool)
    below = [*grid.leaves, *(t[0] for t in grid.tiles if t[1] < cell)]
    for position in below:
        if _floor(position, edge) == origin:
            child[tuple((p - o) // cell for p, o in zip(position, origin, strict=True))] = True
    for position, size, value, on in grid.tiles:
        if size == cell and _floor(position, edge) == origin:
            index = tuple((p - o) // cell for p, o in zip(position, origin, strict=True))
            values[index], active[index] = value, on
    topology, buffers = _mask(child) + _mask(active) + _values(values, active, grid), b""
    for index in np.argwhere(child):
        position = tuple(int(o + cell * i) for o, i in zip(origin, index, strict=True))
        if cell == 8:
            leaf_values, leaf_active = grid.leaves[position]
            topology += _mask(leaf_active)
            buffers += _mask(leaf_active) + _values(leaf_values, leaf_active, grid)
        else:
            nodes, leaves = _node(grid, position, cell)
            topology, buffers = topology + nodes, buffers + leaves
    return topology, buffers


def _floor(position: tuple[int, ...], edge: int) -> tuple[int, ...]:
    return tuple(p // edge * edge for p in position)
