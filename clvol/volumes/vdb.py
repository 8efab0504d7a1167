"""OpenVDB files: one grid as a SparseGrid, or what a file holds without reading its trees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.errors import VolumeError
from clvol.volumes.files import MAX_BYTES, place
from clvol.volumes.grid_info import GridInfo, chosen, listed_names, missing
from clvol.volumes.vdb_header import (
    COMPRESSION_NAMES,
    Descriptor,
    GridHeader,
    check_transform,
    grid_name,
    read_descriptors,
    read_file_header,
    read_grid_header,
)
from clvol.volumes.vdb_stream import VdbStream, open_vdb
from clvol.volumes.vdb_tree import ValueType, VdbTree

if TYPE_CHECKING:
    import os

    from clvol.volumes.grid import SparseGrid

# OpenVDB's names of the voxel types that convert to float32.
VALUE_TYPES = {
    "float": ValueType("f"),
    "double": ValueType("d"),
    "half": ValueType("e"),
    "int32": ValueType("i"),
    "int64": ValueType("q"),
    "vec3s": ValueType("f", 3),
    "vec3d": ValueType("d", 3),
}
MASK = "say where something is, not how much"
# Those that are stored as halves where a grid says so; others may say it too.
HALVED = ("float", "double", "vec3s", "vec3d")


def list_vdb(path: str | os.PathLike[str]) -> list[GridInfo]:
    """Grids of an OpenVDB file in the file's order; no tree is read.

    Raises VolumeError if the file is not OpenVDB 222–224 or its directory is damaged.
    """
    with open_vdb(path) as stream:
        descriptors, damage = _directory(stream)
        if damage:
            raise damage
        return [_info(descriptor, read_grid_header(stream, descriptor)) for descriptor in descriptors]


def _info(descriptor: Descriptor, header: GridHeader) -> GridInfo:
    value = VALUE_TYPES.get(descriptor.value_type)
    unreadable = ""
    if value is None:
        unreadable = _refusal(descriptor.value_type)
    elif header.index_to_world is None:
        unreadable = f"its transform is a {header.transform}: affine ones can be read"
    return GridInfo(
        name=descriptor.name,
        value_type=descriptor.value_type,
        half=header.half and descriptor.value_type in HALVED,
        channels=0 if value is None or unreadable else value.channels,
        kind=header.kind,
        compression=tuple(name for flag, name in COMPRESSION_NAMES.items() if header.compression & flag),
        active_box=header.active_box,
        active_voxels=header.active_voxels,
        transform=header.transform,
        index_to_world=header.index_to_world,
        parent=grid_name(descriptor.parent),
        unreadable=unreadable,
    )


def _refusal(value_type: str) -> str:
    """Why grids of a type have no use here."""
    why = f", which {MASK}" if value_type in ("bool", "mask") else ""
    return f"its values are {value_type}{why}: those of {', '.join(VALUE_TYPES)} grids can be read"


def read_vdb(
    path: str | os.PathLike[str], grid: str | int | None = None, *, max_bytes: int = MAX_BYTES
) -> SparseGrid:
    """One grid of an OpenVDB file.

    Parameters
    ----------
    path : a .vdb file, versions 222–224 (225 with a warning).
    grid : its name, or its number in the file's order, from 0.  Grids of the same name are told apart as
        OpenVDB does, "density[0]", "density[1]", …; the plain name is the first of them, with a warning.
        None is "density", or the only grid of the file.
    max_bytes : what the returned arrays may take; a file that needs more is refused before they exist.

    Raises
    ------
    VolumeError
        The file is missing, damaged, needs more than `max_bytes`, or has no such grid of float, double,
        half, int32, int64, vec3s or vec3d values (all become float32) under an affine transform.

    Source: OpenVDB 12, io/Archive.cc, io/Compression.h, tree/RootNode.h, InternalNode.h, LeafNode.h.
    """
    with open_vdb(path) as stream:
        descriptor, data = find_grid(stream, grid)
        stream.where = place(str(path), descriptor.name)
        value = _value_type(stream, data)
        if descriptor.end_pos > stream.end or data.end_pos > stream.end:
            stream.fail(f"its last byte is {data.end_pos}, the file ends at {stream.end}")
        header = read_grid_header(stream, descriptor)
        index_to_world, kind = check_transform(stream, header), header.kind
        if data is not descriptor:
            header = read_grid_header(stream, data)
        half = header.half and data.value_type in HALVED
        tree = VdbTree(stream, value, half, header.compression, max_bytes)
        tree.read()
        if stream.pos != data.end_pos:
            stream.fail(f"its tree ends at byte {stream.pos}, the directory says {data.end_pos}")
    return tree.grid(index_to_world, kind, descriptor.name, str(path))


def find_grid(stream: VdbStream, grid: str | int | None) -> tuple[Descriptor, Descriptor]:
    """The directory's entries of the grid, and of the grid whose tree it uses (itself or its parent).

    `grid` : its name or number; of several grids with one name, that name is the first, with a warning.
    """
    entries, damage = _directory(stream)
    found = _found(stream, entries, "density" if damage and grid is None else grid)
    if found:
        parent = found[0].parent
        for entry in found if not parent else entries:
            if not parent or (entry.unique_name == parent and not entry.parent):
                return found[0], entry
    if damage:
        raise damage
    if found:
        stream.fail(f"grid {found[0].name!r} shares the tree of {parent!r}, which the file lacks")
    stream.fail(missing(grid), listed_names(entries))


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


def _found(stream: VdbStream, entries: list[Descriptor], grid: str | int | None) -> list[Descriptor]:
    """Those entries that a name or number means; one may also be named as the file does, with 0x1e."""
    unique = [entry for entry in entries if entry.unique_name == grid != entry.plain_name]
    return unique or chosen(entries, grid, stream.where)


def _value_type(stream: VdbStream, descriptor: Descriptor) -> ValueType:
    """How the grid's values are stored; VolumeError if they do not become float32."""
    value = VALUE_TYPES.get(descriptor.value_type)
    if value is None:
        why = f"such values {MASK}: " if descriptor.value_type in ("bool", "mask") else ""
        stream.fail(
            f"its values are {descriptor.grid_type!r}, which is not supported",
            f"{why}choose a grid of {', '.join(VALUE_TYPES)} values",
        )
    return value
