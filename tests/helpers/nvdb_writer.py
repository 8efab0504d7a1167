"""Writes small NanoVDB files (version 32) for tests, independently of the reader.

Where nodes have their fields is looked up in a table, that of NanoVDB's own PNanoVDB.h.  Grids are those of
`vdb_writer`; of several channels values have a last axis for them.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import blosc
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vdb_writer import GridSpec

NONE, ZIP, BLOSC = range(3)
NAMES = ["?", "Float", "Double", "Int16", "Int32", "Int64", "Vec3f", "Vec3d", "Mask", "Half", "UInt32"]
NAMES += ["Boolean", "RGBA8", "Fp4", "Fp8", "Fp16", "FpN", "Vec4f", "Vec4d", "Index", "OnIndex", "IndexMask"]
NAMES += ["OnIndexMask", "PointIndex", "Vec3u8", "Vec3u16", "UInt8"]
# number, then of the root: background, size; of its tiles: value, size; entry of a table; upper nodes: table,
# size; lower nodes: table, size; leaves: values, size
LAYOUTS = {
    "Float": ("<f4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 2144),
    "Double": ("<f8", 32, 96, 24, 32, 8, 8256, 270400, 1088, 33856, 128, 4224),
    "Int16": ("<i2", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 1120),
    "Int32": ("<i4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 2144),
    "Int64": ("<i8", 32, 96, 24, 32, 8, 8256, 270400, 1088, 33856, 128, 4224),
    "UInt32": ("<u4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 2144),
    "UInt8": ("<u1", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 608),
    "Half": ("<f2", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 1120),
    "Vec3f": ("<f4", 28, 96, 20, 32, 16, 8256, 532544, 1088, 66624, 128, 6272),
    "Vec3d": ("<f8", 32, 128, 24, 64, 24, 8288, 794720, 1120, 99424, 160, 12448),
    "Fp4": ("<f4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 352),
    "Fp8": ("<f4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 608),
    "Fp16": ("<f4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 1120),
    "FpN": ("<f4", 28, 64, 20, 32, 8, 8256, 270400, 1088, 33856, 96, 0),
}
BITS = {"Fp4": 4, "Fp8": 8, "Fp16": 16}
CLASSES = {"": 0, "level set": 1, "fog volume": 2, "staggered": 3}


def version_number(major: int, minor: int, patch: int) -> int:
    return major << 21 | minor << 10 | patch


def write_nvdb(
    path,
    grids: Sequence[GridSpec],
    kinds="Float",
    codec=NONE,
    version=(32, 4, 2),
    magic=b"NanoVDB0",
    uncounted=0,
) -> bytes:
    """Write a segment with the grids; `kinds` is a type, or one for each.  Returns the file's bytes.

    uncounted : bytes of each grid that its size in the file leaves out.
    """
    kinds = [kinds] * len(grids) if isinstance(kinds, str) else kinds
    number = version_number(*version)
    out = bytearray(struct.pack("<8sIHH", magic, number, len(grids), codec))
    blobs = []
    for spec, kind in zip(grids, kinds, strict=True):
        raw = grid_bytes(spec, kind, number, magic)
        blobs.append(packed(raw, codec))
        name = spec.name.encode() + b"\0"
        out += struct.pack("<4Q", len(raw), len(blobs[-1]) - uncounted, 0, 0) + struct.pack(
            "<2I", NAMES.index(kind), 0
        )
        out += struct.pack("<6d6i3dI4I3I2HI", *[0] * 15, len(name), *[0] * 7, codec, 0, number) + name
    path.write_bytes(out + b"".join(blobs))
    return path.read_bytes()


def packed(raw: bytes, codec: int, chunk: int = 1 << 20) -> bytes:
    """A grid's bytes as a file keeps them; a chunk of zip, several of blosc."""
    if codec == NONE:
        return raw
    if codec == ZIP:
        chunks = [zlib.compress(raw)]
    else:
        parts = [raw[first : first + chunk] for first in range(0, len(raw), chunk)]
        chunks = [blosc.compress(part, typesize=4, cname="lz4") for part in parts]
    return b"".join(struct.pack("<Q", len(part)) + part for part in chunks)


def quantised(values: np.ndarray, bits: int) -> tuple[float, float, np.ndarray]:
    """Minimum and quantum, float32, and the code of each value."""
    low, high = np.float32(values.min()), np.float32(values.max())
    quantum = np.float32((high - low) / np.float32(2**bits - 1)) or np.float32(1)
    return low, quantum, np.rint((values - low) / quantum).astype(np.int64)


def bits_of(kind: str, number: int) -> int:
    """Bits of a quantised value in a leaf: of FpN they differ from leaf to leaf."""
    return BITS.get(kind, (1, 2, 4, 8, 16)[number % 5])


def stored_values(values: np.ndarray, kind: str, number: int = 0) -> np.ndarray:
    """What the values of a leaf become in a file, as float32."""
    if not kind.startswith("Fp"):
        return values.astype(LAYOUTS[kind][0]).astype(np.float32)
    low, quantum, codes = quantised(values, bits_of(kind, number))
    return codes.astype(np.float32) * quantum + low


def grid_bytes(spec: GridSpec, kind: str, version: int = 67112962, magic: bytes = b"NanoVDB0") -> bytes:
    """A whole grid: its head, tree, root, upper nodes, lower nodes, leaves."""
    kind = kind if kind in LAYOUTS else "Float"
    number, back, root_size, value_at, tile_size, entry, *nodes, leaf_at, leaf_size = LAYOUTS[kind]
    inner = [tile for tile in spec.tiles if tile[1] < 4096]
    root_tiles = [tile for tile in spec.tiles if tile[1] == 4096]
    places = [*spec.leaves, *(tile[0] for tile in inner)]
    uppers = sorted({_floor(place, 4096) for place in places})
    lower_places = [*spec.leaves, *(tile[0] for tile in inner if tile[1] == 8)]
    lowers = sorted({_floor(place, 128) for place in lower_places})
    leaves = [_leaf(*leaf, kind, n, leaf_at, leaf_size) for n, leaf in enumerate(spec.leaves.items())]
    root = 736
    first_upper = root + root_size + tile_size * (len(uppers) + len(root_tiles))
    first_lower = first_upper + nodes[1] * len(uppers)
    leaf_starts = first_lower + nodes[3] * len(lowers) + np.cumsum([0, *map(len, leaves)])
    at_upper = {place: first_upper + nodes[1] * n for n, place in enumerate(uppers)}
    at_lower = {place: first_lower + nodes[3] * n for n, place in enumerate(lowers)}
    at_leaf = dict(zip(spec.leaves, leaf_starts.tolist(), strict=False))
    head = bytearray(root_size)
    struct.pack_into("<I", head, 24, len(uppers) + len(root_tiles))
    _put(head, back, spec.background, number)
    struct.pack_into("<6i", head, 0, 1, 1, 1, 0, 0, 0)
    for place in uppers:
        tile = bytearray(tile_size)
        struct.pack_into("<QqI", tile, 0, _key(place), at_upper[place] - root, 0)
        head += tile
    for place, _, value, active in root_tiles:
        tile = bytearray(tile_size)
        struct.pack_into("<QqI", tile, 0, _key(place), 0, active)
        _put(tile, value_at, value, number)
        head += tile
    body = b"".join(_node(spec, p, 4096, nodes[:2], entry, number, at_upper[p], at_lower) for p in uppers)
    body += b"".join(_node(spec, p, 128, nodes[2:], entry, number, at_lower[p], at_leaf) for p in lowers)
    body = bytes(head) + body + b"".join(leaves)
    return _head(spec, kind, version, magic, len(body) + root, root) + body


def _head(spec: GridSpec, kind: str, version: int, magic: bytes, size: int, root: int) -> bytes:
    head = bytearray(736)
    struct.pack_into("<8sQI", head, 0, b"NanoVDB0" if magic == b"NanoVDB0" else b"NanoVDB1", 0, version)
    struct.pack_into("<IIIQ", head, 20, 0, 0, 1, size)
    head[40 : 40 + len(spec.name.encode())] = spec.name.encode()
    matrix = np.array(spec.transform[1], float) if spec.transform[0] == "AffineMap" else np.eye(4).ravel()
    matrix = matrix.reshape(4, 4).T  # for row vectors, as OpenVDB stores it
    struct.pack_into("<9d", head, 296 + 88, *matrix[:3, :3].ravel())
    struct.pack_into("<3d", head, 296 + 232, *matrix[:3, 3])
    kind = spec.grid_type or kind
    grid_class = next((v.decode() for name, _, v in spec.metadata if name == "class"), "")
    struct.pack_into("<2I", head, 632, CLASSES[grid_class], NAMES.index(kind))
    struct.pack_into("<4q", head, 672, 0, 0, 0, root - 672)
    return bytes(head)


def _node(spec, place, edge, layout, entry, number, at, below) -> bytes:
    """An internal node of `edge` samples."""
    table, size = layout
    cell = 128 if edge == 4096 else 8
    count = edge // cell
    node, children = bytearray(size), np.zeros((count,) * 3, bool)
    active = np.zeros(children.shape, bool)
    struct.pack_into("<3i", node, 0, *place)
    background = bytearray(entry)
    _put(background, 0, spec.background, number)
    node[table : table + entry * count**3] = background * count**3
    for child, where in below.items():
        if _floor(child, edge) == place:
            index = tuple((c - p) // cell for c, p in zip(child, place, strict=True))
            children[index] = True
            struct.pack_into("<q", node, table + entry * _row(index, count), where - at)
    for origin, tile_edge, value, on in spec.tiles:
        if tile_edge == cell and _floor(origin, edge) == place:
            index = tuple((c - p) // cell for c, p in zip(origin, place, strict=True))
            active[index] = on
            _put(node, table + entry * _row(index, count), value, number)
    masks = _mask(active) + _mask(children)
    node[32 : 32 + len(masks)] = masks
    return bytes(node)


def _leaf(place, held, kind: str, number: int, values_at: int, size: int) -> bytes:
    (values, active), head = held, bytearray(values_at)
    bits = bits_of(kind, number)
    struct.pack_into("<3i", head, 0, *place)
    head[15] = (bits.bit_length() - 1) << 5 if kind == "FpN" else 0
    head[16:80] = _mask(active)
    if not kind.startswith("Fp"):
        return (bytes(head) + values.astype(LAYOUTS[kind][0]).tobytes()).ljust(size, b"\0")
    low, quantum, codes = quantised(values, bits)
    struct.pack_into("<2f", head, 80, low, quantum)
    digits = codes.reshape(-1, 1) >> np.arange(bits) & 1
    return bytes(head) + np.packbits(digits.astype(bool).reshape(-1), bitorder="little").tobytes()


def _put(target: bytearray, at: int, value, number: str) -> None:
    raw = np.asarray(value).astype(number).tobytes()
    target[at : at + len(raw)] = raw


def _row(index: tuple[int, ...], count: int) -> int:
    return (index[0] * count + index[1]) * count + index[2]


def _mask(bits: np.ndarray) -> bytes:
    return np.packbits(bits.reshape(-1), bitorder="little").tobytes()


def _key(place: tuple[int, ...]) -> int:
    x, y, z = ((coordinate & 0xFFFFFFFF) >> 12 for coordinate in place)
    return x << 42 | y << 21 | z


def _floor(position: tuple[int, ...], edge: int) -> tuple[int, ...]:
    return tuple(p // edge * edge for p in position)
