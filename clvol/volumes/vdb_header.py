"""What an OpenVDB file says before its trees: grids, metadata, compression, transforms."""

from __future__ import annotations

import itertools
import re
import struct
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.volumes.grid import KINDS
from clvol.volumes.vdb_stream import ACTIVE_MASK, BLOSC, ZIP, VdbStream

if TYPE_CHECKING:
    from collections.abc import Iterator

MAGIC = struct.pack("<q", 0x56444220)
OLDEST_VERSION, NEWEST_VERSION, WARNED_VERSION = 222, 224, 225
UUID_BYTES = 36
# Between a name and the number that tells grids of that name apart.
SUFFIX = "\x1e"
# Smallest bytes an entry can take: bounds on counts before any loop starts.
SMALLEST_GRID, SMALLEST_METADATUM = 36, 12

# Doubles each transform stores, and which of them make the matrix: all of a matrix, or three of a
# translation and three of a scale.
MATRIX_MAPS = ("AffineMap", "UnitaryMap")
SCALE_MAPS = ("UniformScaleMap", "ScaleMap")
SCALE_TRANSLATE_MAPS = ("UniformScaleTranslateMap", "ScaleTranslateMap")

COMPRESSION_NAMES = {ZIP: "zip", ACTIVE_MASK: "active mask", BLOSC: "blosc"}


@dataclass(frozen=True)
class Descriptor:
    """One entry of the file's directory of grids.

    `unique_name` still carries the suffix after 0x1e that tells grids of the same name apart; `parent` is
    that of the grid whose tree this one shares, or ""; positions are in bytes from the start of the file.
    """

    unique_name: str
    grid_type: str
    parent: str
    grid_pos: int
    end_pos: int

    @property
    def plain_name(self) -> str:
        """The name that several grids of a file may have."""
        return self.unique_name.split(SUFFIX)[0]

    @property
    def name(self) -> str:
        """The name that only this grid has."""
        return grid_name(self.unique_name)

    @property
    def value_type(self) -> str:
        """Name of the voxel type: "float", "vec3s", …; the whole type for other trees than 5-4-3."""
        found = re.fullmatch(r"Tree_(\w+)_5_4_3", self.grid_type.removesuffix("_HalfFloat"))
        return found[1] if found else self.grid_type


def grid_name(unique_name: str) -> str:
    """A unique name in OpenVDB's way: the second "density" is "density[1]"."""
    plain, _, number = unique_name.partition(SUFFIX)
    return f"{plain}[{number}]" if number not in ("", "0") else plain


@dataclass(frozen=True)
class GridHeader:
    """What a grid says before its tree; `index_to_world` is None for a map that is not affine.

    half : floats and doubles are stored as 16-bit floats.  OpenVDB goes by this, not by the type's suffix.
    kind : one of clvol.volumes.grid.KINDS, or "".
    """

    compression: int
    half: bool
    kind: str
    active_box: np.ndarray | None
    active_voxels: int | None
    transform: str
    index_to_world: np.ndarray | None


def read_file_header(stream: VdbStream) -> int:
    """Check magic and version, step over the file's metadata; the number of grids."""
    magic = stream.take(min(stream.end, 8))
    if magic != MAGIC:
        stream.fail("is not an OpenVDB file (wrong magic number)", "")
    (version,) = stream.unpack("<I")
    if version == WARNED_VERSION:
        warnings.warn(
            f"{stream.where}: OpenVDB file version {version} is newer than this reader", stacklevel=4
        )
    elif not OLDEST_VERSION <= version <= NEWEST_VERSION:
        stream.fail(
            f"OpenVDB file version {version} is not supported, {OLDEST_VERSION} to {NEWEST_VERSION} are",
            "write it again with OpenVDB 3 or later",
        )
    _, _, has_offsets = stream.unpack("<IIB")
    if not has_offsets:
        stream.fail(
            "was written as a stream, without grid offsets", "write it again as a file (vdb::io::File)"
        )
    stream.skip(UUID_BYTES)
    read_metadata(stream)
    (count,) = stream.unpack("<i")
    if not 0 <= count <= (stream.end - stream.pos) // SMALLEST_GRID:
        stream.fail(f"{count} grids are announced in a file of {stream.end} bytes")
    return int(count)


def read_metadata(stream: VdbStream) -> dict[str, bytes]:
    """Values by name, as stored bytes; long ones (delay-load tables, thumbnails) are left out."""
    (count,) = stream.unpack("<i")
    if not 0 <= count <= (stream.end - stream.pos) // SMALLEST_METADATUM:
        stream.fail(f"{count} metadata are announced in a file of {stream.end} bytes")
    values = {}
    for _ in range(count):
        name = stream.string()
        stream.string()
        (size,) = stream.unpack("<I")
        if size <= 64:
            values[name] = stream.take(size)
        else:
            stream.skip(size)
    return values


def read_descriptors(stream: VdbStream, count: int) -> Iterator[Descriptor]:
    """The directory's entries in the file's order, each read when it is asked for.

    Entries lie between the grids, so a file that is cut after a grid still gives the grids before.
    """
    taken: set[str] = set()
    for _ in range(count):
        unique_name, grid_type, parent = stream.string(), stream.string(), stream.string()
        grid_pos, block_pos, end_pos = stream.unpack("<3q")
        # A grid that shares another one's tree has no blocks, and their offset means nothing.
        if not (stream.pos <= grid_pos <= end_pos and (parent or grid_pos <= block_pos <= end_pos)):
            where = f"offsets {grid_pos}, {block_pos}, {end_pos} at byte {stream.pos}"
            stream.fail(f"grid {unique_name!r} has {where}")
        if unique_name in taken:  # not by OpenVDB, which numbers them
            unique_name = next(
                n for k in itertools.count(1) if (n := f"{unique_name}{SUFFIX}{k}") not in taken
            )
        taken.add(unique_name)
        yield Descriptor(unique_name, grid_type, parent, grid_pos, end_pos)
        stream.seek(end_pos)


def read_grid_header(stream: VdbStream, descriptor: Descriptor) -> GridHeader:
    """Compression, metadata and transform at the grid's position; the cursor then stands at the tree."""
    stream.seek(descriptor.grid_pos)
    (compression,) = stream.unpack("<I")
    if compression & ~(ZIP | ACTIVE_MASK | BLOSC):
        stream.fail(f"compression flags {compression:#x} are unknown")
    metadata = read_metadata(stream)
    lower, upper = metadata.get("file_bbox_min", b""), metadata.get("file_bbox_max", b"")
    box = None
    if len(lower) == len(upper) == 12:
        box = np.frombuffer(lower + upper, "<i4").reshape(2, 3)
    voxels = metadata.get("file_voxel_count", b"")
    kind = metadata.get("class", b"").decode("ascii", errors="replace")
    transform = stream.string()
    return GridHeader(
        compression=compression,
        half=any(metadata.get("is_saved_as_half_float", b"")),
        kind=kind if kind in KINDS else "",
        active_box=box,
        active_voxels=struct.unpack("<q", voxels)[0] if len(voxels) == 8 else None,
        transform=transform,
        index_to_world=read_transform(stream, transform),
    )


def read_transform(stream: VdbStream, kind: str) -> np.ndarray | None:
    """Matrix (4, 4) float64 for column vectors, index to world; None for a frustum or an unknown map."""
    matrix = np.eye(4)
    if kind in MATRIX_MAPS:
        # On disk for row vectors.
        matrix = np.array(stream.unpack("<16d")).reshape(4, 4).T
    elif kind in SCALE_MAPS:
        # Scale, voxel size, and three inverses that follow from it.
        matrix[range(3), range(3)] = stream.unpack("<15d")[:3]
    elif kind in SCALE_TRANSLATE_MAPS:
        values = stream.unpack("<18d")
        matrix[:3, 3] = values[:3]
        matrix[range(3), range(3)] = values[3:6]
    elif kind == "TranslationMap":
        matrix[:3, 3] = stream.unpack("<3d")
    else:
        return None
    return matrix


def check_transform(stream: VdbStream, header: GridHeader) -> np.ndarray:
    """The header's matrix if it maps index space to world space one to one; VolumeError otherwise."""
    matrix = header.index_to_world
    if matrix is None:
        stream.fail(
            f"transform {header.transform!r} is not supported, affine maps are",
            "resample the grid to an affine transform",
        )
    check_matrix(stream, matrix, header.transform)
    return matrix


def check_matrix(stream: VdbStream, matrix: np.ndarray, name: str) -> None:
    """VolumeError unless a matrix (4, 4), of a map of this name, is affine and can be inverted."""
    if not np.isfinite(matrix).all() or not np.array_equal(matrix[3], [0, 0, 0, 1]):
        stream.fail(f"the matrix of its {name} is not affine and finite")
    with np.errstate(over="ignore", under="ignore"):
        determinant = np.linalg.det(matrix[:3, :3])
    if not np.isfinite(determinant) or determinant == 0:
        stream.fail(f"the matrix of its {name} cannot be inverted")
