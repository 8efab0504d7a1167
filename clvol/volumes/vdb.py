"""OpenVDB files: one grid as a SparseGrid, or what a file holds without reading its trees."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import VolumeError
from clvol.volumes.files import MAX_BYTES, place
from clvol.volumes.grid import SparseGrid
from clvol.volumes.vdb_header import (
    COMPRESSION_NAMES,
    Descriptor,
    check_transform,
    grid_name,
    read_descriptors,
    read_file_header,
    read_grid_header,
)
from clvol.volumes.vdb_stream import VdbStream, open_vdb
from clvol.volumes.vdb_tree import VdbTree

if TYPE_CHECKING:
    import os

log = logging.getLogger("clvol")

# OpenVDB's names of the voxel types that convert to float32, with the letters of struct and NumPy.
VALUE_TYPES = {"float": "f", "double": "d", "int32": "i", "int64": "q"}
# Those that are stored as halves where a grid says so; others may say it too.
HALVED = ("float", "double", "vec3s", "vec3d")


@dataclass(frozen=True, eq=False)
class VdbGridInfo:
    """What a file says about one grid without its tree.

    name : "density", or "density[1]" for the second of that name.
    value_type : "float", "vec3s", …; half : values stored as 16-bit floats.
    compression : any of "zip", "blosc", "active mask".
    active_box : int32 (2, 3), inclusive, and active_voxels : from the grid's metadata, None if absent.
    transform : OpenVDB's name of the map; index_to_world : float64 (4, 4), None if it is not affine.
    parent : name of the grid whose tree it shares, or "".
    """

    name: str
    value_type: str
    half: bool
    compression: tuple[str, ...]
    active_box: np.ndarray | None
    active_voxels: int | None
    transform: str
    index_to_world: np.ndarray | None
    parent: str

    @property
    def unreadable(self) -> str:
        """Why `read_vdb` has no use for the grid; "" where it has."""
        if self.value_type not in VALUE_TYPES:
            return f"its values are {self.value_type}: those of {', '.join(VALUE_TYPES)} grids can be read"
        if self.index_to_world is None:
            return f"its transform is a {self.transform}: affine ones can be read"
        return ""


def list_vdb(path: str | os.PathLike[str]) -> list[VdbGridInfo]:
    """Grids of an OpenVDB file in the file's order; no tree is read.

    Raises VolumeError if the file is not OpenVDB 222–224 or its directory is damaged.
    """
    with open_vdb(path) as stream:
        descriptors, damage = _directory(stream)
        if damage:
            raise damage
        grids = []
        for descriptor in descriptors:
            header = read_grid_header(stream, descriptor)
            flags = tuple(name for flag, name in COMPRESSION_NAMES.items() if header.compression & flag)
            grids.append(
                VdbGridInfo(
                    name=descriptor.name,
                    value_type=descriptor.value_type,
                    half=header.half and descriptor.value_type in HALVED,
                    compression=flags,
                    active_box=header.active_box,
                    active_voxels=header.active_voxels,
                    transform=header.transform,
                    index_to_world=header.index_to_world,
                    parent=grid_name(descriptor.parent),
                )
            )
    return grids


def read_vdb(
    path: str | os.PathLike[str], grid: str | int = "density", *, max_bytes: int = MAX_BYTES
) -> SparseGrid:
    """One scalar grid of an OpenVDB file.

    Parameters
    ----------
    path : a .vdb file, versions 222–224 (225 with a warning).
    grid : its name, or its number in the file's order, from 0.  Grids of the same name are told apart as
        OpenVDB does, "density[0]", "density[1]", …; the plain name is the first of them, with a warning.
    max_bytes : what the returned arrays may take; a file that needs more is refused before they exist.

    Raises
    ------
    VolumeError
        The file is missing, damaged, needs more than `max_bytes`, or has no such grid of float,
        double, int32 or int64 values (all become float32) under an affine transform.

    Source: OpenVDB 12, io/Archive.cc, io/Compression.h, tree/RootNode.h, InternalNode.h, LeafNode.h.
    """
    with open_vdb(path) as stream:
        descriptor, data = find_grid(stream, grid)
        stream.where = place(str(path), descriptor.name)
        code = _value_code(stream, data)
        if descriptor.end_pos > stream.end or data.end_pos > stream.end:
            stream.fail(f"its last byte is {data.end_pos}, the file ends at {stream.end}")
        header = read_grid_header(stream, descriptor)
        index_to_world = check_transform(stream, header)
        if data is not descriptor:
            header = read_grid_header(stream, data)
        tree = VdbTree(stream, code, header.half and code in "fd", header.compression, max_bytes)
        tree.read()
        if stream.pos != data.end_pos:
            stream.fail(f"its tree ends at byte {stream.pos}, the directory says {data.end_pos}")
    return SparseGrid(
        leaf_origins=tree.leaf_origins,
        leaf_values=tree.leaf_values,
        leaf_active=tree.leaf_active,
        tile_origins=tree.tile_origins,
        tile_sizes=tree.tile_sizes,
        tile_values=tree.tile_values,
        tile_active=tree.tile_active,
        background=float(tree.background),
        index_to_world=index_to_world,
        active_box=active_box(tree),
        name=descriptor.name,
        source=str(path),
    )


def find_grid(stream: VdbStream, grid: str | int) -> tuple[Descriptor, Descriptor]:
    """The directory's entries of the grid, and of the grid whose tree it uses (itself or its parent).

    `grid` : its name or number; of several grids with one name, that name is the first, with a warning.
    """
    entries, damage = _directory(stream)
    found = _named(stream, entries, grid) if isinstance(grid, str) else entries[grid : grid + 1]
    if found:
        parent = found[0].parent
        for entry in found if not parent else entries:
            if not parent or (entry.unique_name == parent and not entry.parent):
                return found[0], entry
    if damage:
        raise damage
    if found:
        stream.fail(f"grid {found[0].name!r} shares the tree of {parent!r}, which the file lacks")
    names = ", ".join(repr(entry.name) for entry in entries)
    stream.fail(f"has no grid {grid!r}", f"its grids are {names}" if names else "it has no grids at all")


def _directory(stream: VdbStream) -> tuple[list[Descriptor], VolumeError | None]:
    """The directory's entries, up to where the file is cut or damaged if it is, and what is wrong there."""
    count = read_file_header(stream)
    entries = []
    try:
        for entry in read_descriptors(stream, count):
            entries.append(entry)
    except VolumeError as error:
        return entries, error
    return entries, None


def _named(stream: VdbStream, entries: list[Descriptor], name: str) -> list[Descriptor]:
    """Those entries that a name means, the first of which is taken.  "density[0]" is the first "density"."""
    exact = [entry for entry in entries if name in (entry.name, entry.unique_name)]
    exact.sort(key=lambda entry: entry.plain_name != name)  # one that is called "density[1]" comes first
    alike = [entry for entry in entries if entry.plain_name == name]
    if len(alike) > 1:
        names = ", ".join([f"{name}[0]", *(entry.name for entry in alike[1:])])
        log.warning(
            "%s: has %d grids named %r; the first is taken, choose by %s",
            stream.where,
            len(alike),
            name,
            names,
        )
    return exact or alike or [entry for entry in entries if f"{entry.name}[0]" == name]


def _value_code(stream: VdbStream, descriptor: Descriptor) -> str:
    """Letter of the grid's values; VolumeError if they are not scalars that become float32."""
    code = VALUE_TYPES.get(descriptor.value_type)
    if code is None:
        stream.fail(
            f"its values are {descriptor.grid_type!r}, which is not supported",
            f"choose a grid of {', '.join(VALUE_TYPES)} values",
        )
    return code


def active_box(tree: VdbTree) -> np.ndarray:
    """Inclusive box of the active samples, int32 (2, 3); upper below lower where there are none."""
    # A mask is 8 x 8 bytes, [x, y], with z in the bits of each byte.
    masks = tree.leaf_active.reshape(-1, 8, 8)
    along_x, along_y = (masks != 0).any(axis=2), (masks != 0).any(axis=1)
    along_z = np.unpackbits(np.bitwise_or.reduce(masks, axis=(1, 2))[:, None], axis=1, bitorder="little")
    used = np.stack([along_x, along_y, along_z.view(bool)], axis=1)
    filled = along_x.any(axis=1)
    first = tree.leaf_origins + used.argmax(axis=2)
    last = tree.leaf_origins + 7 - used[:, :, ::-1].argmax(axis=2)
    tiles = tree.tile_origins[tree.tile_active]
    tile_last = tiles + tree.tile_sizes[tree.tile_active][:, None] - 1
    lower, upper = np.concatenate([first[filled], tiles]), np.concatenate([last[filled], tile_last])
    if not len(lower):
        return np.array([[0, 0, 0], [-1, -1, -1]], np.int32)
    return np.stack([lower.min(axis=0), upper.max(axis=0)]).astype(np.int32)
