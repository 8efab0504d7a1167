"""What a NanoVDB file says before its grids' trees: segments, names, types, transforms."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import VolumeError
from clvol.volumes.grid import FOG_VOLUME, LEVEL_SET, STAGGERED
from clvol.volumes.grid_info import numbered
from clvol.volumes.nvdb_bytes import CODEC_NAMES, MOST_RATIO, NONE, GridBytes

if TYPE_CHECKING:
    from clvol.volumes.vdb_stream import VdbStream

# A file of segments begins with the first or the third, a bare grid with the first or the second.
MAGIC, MAGIC_GRID, MAGIC_FILE = b"NanoVDB0", b"NanoVDB1", b"NanoVDB2"
MAGICS = (MAGIC, MAGIC_GRID, MAGIC_FILE)
MAJOR_VERSION = 32
HEADER = struct.Struct("<8sIHH")
METADATA = struct.Struct("<4Q2I6d6i3dI4I3I2HI")
GRID_BYTES, TREE_BYTES = 672, 64
LONGEST_NAME = 1 << 16
MOST_TOGETHER = 1 << 12

TYPES = [
    "unknown",
    "Float",
    "Double",
    "Int16",
    "Int32",
    "Int64",
    "Vec3f",
    "Vec3d",
    "Mask",
    "Half",
    "UInt32",
    "Boolean",
    "RGBA8",
    "Fp4",
    "Fp8",
    "Fp16",
    "FpN",
    "Vec4f",
    "Vec4d",
    "Index",
    "OnIndex",
    "IndexMask",
    "OnIndexMask",
    "PointIndex",
    "Vec3u8",
    "Vec3u16",
    "UInt8",
]
"""NanoVDB's types of grids, by number."""
KINDS = {1: LEVEL_SET, 2: FOG_VOLUME, 3: STAGGERED}


@dataclass(frozen=True)
class NanoEntry:
    """One grid of a file: its name, the number of those of that name before it, and where it is.

    before : bytes of the grids that are packed with it and come first.
    """

    plain_name: str
    number: int
    codec: int
    start: int
    packed: int
    size: int
    before: int = 0

    @property
    def name(self) -> str:
        """The name that only this grid has."""
        return numbered(self.plain_name, self.number)

    def bytes_of(self, stream: VdbStream) -> GridBytes:
        """Its bytes, unpacked as they are read."""
        return GridBytes(stream, self.codec, self.start, self.packed, self.size, self.before)


@dataclass(frozen=True, eq=False)
class NanoGrid:
    """What a grid says before its tree: `value_type` is one of TYPES, `root` where its root node is.

    active_box : int32 (2, 3), inclusive; None where the file does not say.
    """

    value_type: str
    kind: str
    index_to_world: np.ndarray
    active_voxels: int
    active_box: np.ndarray | None
    root: int


def read_entries(stream: VdbStream) -> list[NanoEntry]:
    """All grids of a file, which is a row of segments or of bare grids; VolumeError where it is damaged."""
    start = stream.take(min(stream.end, 8))
    if start not in MAGICS:
        swapped = start[::-1] in MAGICS
        order = "its bytes are in big-endian order" if swapped else "wrong magic number"
        stream.fail(f"is not a NanoVDB file ({order})", "")
    entries: list[NanoEntry] = []
    at = 0
    while at < stream.end:
        stream.seek(at)
        at = _bare_grid(stream, entries) if _is_bare(stream) else _segment(stream, entries)
    return entries


def _is_bare(stream: VdbStream) -> bool:
    """Whether a grid stands at the cursor without the header of a file, as may be since version 32.6."""
    at = stream.pos
    magic = stream.take(min(8, stream.end - at))
    bare = magic == MAGIC_GRID
    if magic == MAGIC and stream.end - at >= GRID_BYTES:
        stream.seek(at)
        header = stream.take(GRID_BYTES)
        segment, grid = (struct.unpack_from("<I", header, place)[0] >> 21 for place in (8, 16))
        bare = header[-8:] == MAGIC_GRID or (segment != MAJOR_VERSION and grid == MAJOR_VERSION)
    stream.seek(at)
    return bare


def _bare_grid(stream: VdbStream, entries: list[NanoEntry]) -> int:
    at = stream.pos
    header = stream.take(GRID_BYTES)
    _check_version(stream, struct.unpack_from("<I", header, 16)[0])
    (size,) = struct.unpack_from("<Q", header, 32)
    if not GRID_BYTES + TREE_BYTES <= size <= stream.end - at:
        stream.fail(f"a grid at byte {at} says that it takes {size} bytes, {stream.end - at} are left")
    name = _text(header[40:296])
    entries.append(NanoEntry(name, _alike(entries, name), NONE, at, size, size))
    return int(at + size)


def _segment(stream: VdbStream, entries: list[NanoEntry]) -> int:
    at = stream.pos
    stream.require(HEADER.size)
    magic, version, count, codec = HEADER.unpack(stream.take(HEADER.size))
    if magic not in (MAGIC, MAGIC_FILE):
        stream.fail(f"no segment begins at byte {at}, where one should")
    _check_version(stream, version)
    if codec not in CODEC_NAMES:
        stream.fail(f"codec {codec} is not known, 0 (none), 1 (zip) and 2 (blosc) are")
    if not count:
        stream.fail(f"the segment at byte {at} has no grids")
    found = []
    for _ in range(count):
        values = METADATA.unpack(stream.take(METADATA.size))
        size, packed, name_bytes = values[0], values[1], values[21]
        if not 0 < name_bytes <= LONGEST_NAME:
            stream.fail(f"a grid's name takes {name_bytes} bytes")
        found.append((_text(stream.take(name_bytes)), size, packed))
    at = stream.pos
    for name, size, counted in found:
        packed = _with_its_size(stream, at, counted, codec)
        if packed > stream.end - at:
            stream.fail(f"grid {name!r} says that it takes {packed} bytes, {stream.end - at} are left")
        if size > MOST_RATIO * packed or (codec == NONE and size != packed):
            stream.fail(f"grid {name!r} says that {packed} bytes of the file hold {size}")
        whole = GridBytes(stream, codec, at, packed, size)
        before = 0
        for one, length in _packed_together(whole, name):
            entries.append(NanoEntry(one, _alike(entries, one), codec, at, packed, length, before))
            before += length
        whole.release()
        at += packed
    return int(at)


def _packed_together(whole: GridBytes, name: str) -> list[tuple[str, int]]:
    """Names and sizes of the grids that a segment has as one.

    Writers of versions up to 32.4 put all grids of a handle there: their headers tell how many there are.
    """
    found = [(name, whole.size)]
    try:
        header = whole.take(0, GRID_BYTES)
    except VolumeError:  # as whoever reads it will say
        return found
    count, size = struct.unpack_from("<I", header, 28)[0], struct.unpack_from("<Q", header, 32)[0]
    if header[:8] not in (MAGIC, MAGIC_GRID) or count < 2 or not GRID_BYTES <= size < whole.size:
        return found
    if count > MOST_TOGETHER:
        whole.fail(f"says that {count} grids are packed together, at most {MOST_TOGETHER} can be read")
    found, at = [(name, size)], size
    while len(found) < count and whole.size - at >= GRID_BYTES:
        header = whole.take(at, GRID_BYTES)
        (size,) = struct.unpack_from("<Q", header, 32)
        if header[:8] not in (MAGIC, MAGIC_GRID) or not GRID_BYTES <= size <= whole.size - at:
            whole.fail(f"grid {len(found)} of {count} that are packed together is none")
        found.append((_text(header[40:296]), size))
        at += size
    return found


def _with_its_size(stream: VdbStream, at: int, packed: int, codec: int) -> int:
    """Bytes of a grid in the file: Warp counts its one chunk without the 64 bits before it, its size."""
    if codec == NONE or packed + 8 > stream.end - at:
        return packed
    stream.seek(at)
    return packed + 8 if stream.unpack("<Q")[0] == packed else packed


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("utf-8", errors="replace")


def _alike(entries: list[NanoEntry], name: str) -> int:
    return sum(1 for entry in entries if entry.plain_name == name)


def _check_version(stream: VdbStream, version: int) -> None:
    if version >> 21 != MAJOR_VERSION:
        stream.fail(
            f"NanoVDB version {version >> 21}.{version >> 10 & 0x7FF} is not supported, {MAJOR_VERSION} is",
            f"write it again with a NanoVDB of version {MAJOR_VERSION}",
        )


def read_grid(grid: GridBytes) -> NanoGrid:
    """The grid's own header and its tree's; VolumeError where they contradict themselves."""
    header = grid.take(0, GRID_BYTES + TREE_BYTES)
    if header[:8] not in (MAGIC, MAGIC_GRID):
        grid.fail("its data does not begin with a grid (wrong magic number)")
    _check_version(grid.stream, struct.unpack_from("<I", header, 16)[0])
    (size,) = struct.unpack_from("<Q", header, 32)
    if size > grid.size:
        grid.fail(f"says that it takes {size} bytes, its file says {grid.size}")
    matrix = np.eye(4)
    # The map follows at 296: a matrix, its inverse and a translation in floats, then the same in doubles.
    matrix[:3, :3] = np.frombuffer(header, "<f8", 9, 296 + 88).reshape(3, 3)
    matrix[:3, 3] = np.frombuffer(header, "<f8", 3, 296 + 232)
    kind, value_type = struct.unpack_from("<2I", header, 632)
    root = GRID_BYTES + struct.unpack_from("<4q", header, GRID_BYTES)[3]
    (active_voxels,) = struct.unpack_from("<Q", header, GRID_BYTES + 56)
    box = np.frombuffer(grid.take(root, 24), "<i4").reshape(2, 3)
    return NanoGrid(
        TYPES[value_type] if value_type < len(TYPES) else f"of an unknown type, {value_type}",
        KINDS.get(kind, ""),
        matrix,
        active_voxels,
        box if (box[0] <= box[1]).all() else None,
        root,
    )
