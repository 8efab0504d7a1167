"""NanoVDB files: one grid as a SparseGrid, or what a file holds without reading its trees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.volumes.files import MAX_BYTES, place
from clvol.volumes.grid_info import GridInfo, chosen, listed_names, missing
from clvol.volumes.nvdb_bytes import CODEC_NAMES
from clvol.volumes.nvdb_header import NanoEntry, NanoGrid, read_entries, read_grid
from clvol.volumes.nvdb_layout import READABLE
from clvol.volumes.nvdb_tree import NanoTree
from clvol.volumes.vdb_header import check_matrix
from clvol.volumes.vdb_stream import open_vdb

if TYPE_CHECKING:
    import os

    from clvol.volumes.grid import SparseGrid

WHY = {
    "Mask": "masks say where something is, not how much",
    "Boolean": "masks say where something is, not how much",
    "PointIndex": "points have no density: rasterise them to a grid first",
}
WHY |= dict.fromkeys(
    ("Index", "OnIndex", "IndexMask", "OnIndexMask"), "its numbers are places in a list that lies elsewhere"
)
"""Reasons for some of the types that are not readable."""


def list_nvdb(path: str | os.PathLike[str]) -> list[GridInfo]:
    """Grids of a NanoVDB file in the file's order; of each its head is read, and no tree.

    Raises VolumeError if the file is not NanoVDB 32 or damaged there.
    """
    infos = []
    with open_vdb(path) as stream:
        for entry in read_entries(stream):
            stream.where = place(str(path), entry.name)
            infos.append(_info(entry, read_grid(entry.bytes_of(stream))))
    return infos


def _info(entry: NanoEntry, grid: NanoGrid) -> GridInfo:
    readable = READABLE.get(grid.value_type)
    return GridInfo(
        name=entry.name,
        value_type=grid.value_type,
        half=False,
        channels=readable.channels if readable else 0,
        kind=grid.kind,
        compression=CODEC_NAMES[entry.codec],
        active_box=grid.active_box,
        active_voxels=grid.active_voxels,
        transform="Map",
        index_to_world=grid.index_to_world,
        parent="",
        unreadable="" if readable else _refusal(grid),
    )


def _refusal(grid: NanoGrid) -> str:
    """Why grids of a type have no use here."""
    why = f" ({WHY[grid.value_type]})" if grid.value_type in WHY else ""
    return f"its values are {grid.value_type}{why}: those of {', '.join(READABLE)} grids can be read"


def read_nvdb(
    path: str | os.PathLike[str], grid: str | int | None = None, *, max_bytes: int = MAX_BYTES
) -> SparseGrid:
    """One grid of a NanoVDB file.

    Parameters
    ----------
    path : a .nvdb file of version 32, of any codec; also bare grids without a file's header.
    grid : its name, or its number in the file's order, from 0; names as `read_vdb` takes them.  None is
        "density", or the only grid of the file.
    max_bytes : what the returned arrays may take; a file that needs more is refused before they exist.

    Raises
    ------
    VolumeError
        The file is missing, damaged, needs more than `max_bytes`, or has no such grid of a type in
        clvol.volumes.nvdb_layout.READABLE (all become float32).

    Source: NanoVDB 32, NanoVDB.h, PNanoVDB.h, io/IO.h.
    """
    with open_vdb(path) as stream:
        entries = read_entries(stream)
        found = chosen(entries, grid, stream.where)
        if not found:
            stream.fail(missing(grid), listed_names(entries))
        stream.where = place(str(path), found[0].name)
        data = found[0].bytes_of(stream)
        header = read_grid(data)
        if header.value_type not in READABLE:
            stream.fail(_refusal(header), "choose another grid")
        check_matrix(stream, header.index_to_world, "Map")
        tree = NanoTree(data, READABLE[header.value_type], max_bytes)
        tree.read(header.root)
    return tree.grid(header.index_to_world, header.kind, found[0].name, str(path))
