"""Volumes: fields of coefficients and where their samples lie in the world."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from clvol.base.files import note_file
from clvol.scene.files import find_parameter, find_volume
from clvol.scene.records import ConstVolume, GridVolume, Volume
from clvol.scene.transforms import scale, translate
from clvol.volumes import dense_from_array, read_volume
from clvol.volumes.files import place
from clvol.volumes.grid import DenseGrid, Grid, SparseGrid
from clvol.volumes.labelled import grid_from_labelled, is_labelled
from clvol.volumes.level_set import USES, fog_of
from clvol.volumes.read import read_sparse, volume_suffix
from clvol.volumes.vol import read_vol

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from clvol.scene.reader import Reader

log = logging.getLogger("clvol")

FILTER_TYPES = ("trilinear", "nearest")
CHANNELS = (1, 3, 6)
"""Of a gridvolume; six are for the S of an sggx alone."""
WRAP_MODES = ("clamp", "repeat", "mirror")


def constvolume(reader: Reader) -> ConstVolume:
    """The `constvolume` plugin: one value."""
    return ConstVolume(reader.color("value", 1.0), reader.transform())


def vdbvolume(reader: Reader) -> Volume:
    """The `vdbvolume` plugin: a grid of an OpenVDB or NanoVDB file, under the grid's own transform."""
    if not reader.has("filename"):
        reader.fail("a vdbvolume needs a filename")
    path = find_parameter(reader, "filename")
    grid = _read(reader, path, reader.string("grid", "") if reader.has("grid") else None, read_sparse)
    if not isinstance(grid, SparseGrid):
        reader.fail(
            f"a vdbvolume reads OpenVDB and NanoVDB, not '{path.name}'", "filename", "use a gridvolume"
        )
    return _sparse_volume(reader, grid)


def gridvolume(reader: Reader) -> Volume:
    """The `gridvolume` plugin: a file, or an array [z, y, x] or [z, y, x, channel].

    Samples sit at the centres of equal cells of the unit cube (or of the file's own box) under
    `to_world`; those of a .vdb or .nvdb file sit where a `vdbvolume` has them, and those of any other file
    that places its samples, as medical images do, where it says, under `to_world` as well.
    """
    reader.ignore(accel=bool, raw=bool, max_value=float)  # majorants are worked out here
    wrap_mode = reader.string("wrap_mode", "clamp", WRAP_MODES)
    use_box = reader.boolean("use_grid_bbox", False)
    grid = _grid(reader)
    if isinstance(grid, SparseGrid):
        if reader.has("use_grid_bbox") and not use_box:
            reader.fail("a sparse grid always lies where its file says", "use_grid_bbox", "use to_world")
        if wrap_mode != "clamp":
            reader.fail(
                "a sparse grid has no wrap_mode: outside its box is the background",
                "wrap_mode",
                "write it as .vol or .npy to repeat it",
            )
        return _sparse_volume(reader, grid)
    size = np.array(grid.values.shape[2::-1], dtype=np.float64)
    local = np.eye(4)
    if grid.index_to_world is not None:
        if reader.has("use_grid_bbox") and not use_box:
            reader.fail("this grid always lies where its file says", "use_grid_bbox", "use to_world")
    elif use_box:
        low, high = np.asarray(grid.box, dtype=np.float64)
        if not (np.isfinite(grid.box).all() and (high > low).all()):
            reader.fail(f"the file's bounding box {grid.box.tolist()} has no volume", "use_grid_bbox")
        local = translate(low) @ scale(high - low)
    if grid.index_to_world is None:
        index_to_world = reader.transform() @ local @ scale(1 / size) @ translate(0.5)
    else:
        index_to_world = reader.transform() @ grid.index_to_world
    filter_type = reader.string("filter_type", "trilinear", FILTER_TYPES)
    return GridVolume(
        grid,
        index_to_world,
        np.full(3, -0.5),
        size - 0.5,
        filter_type,
        wrap_mode,
        source=grid.source,
        sanitize=reader.boolean("sanitize", False),
    )


def _grid(reader: Reader) -> Grid:
    """The samples of a gridvolume, from the one source it gives; each file is read once per scene."""
    # `grid` is the name of a grid when it is a string (in files that hold several), else an array.
    name = None
    if reader.has("grid") and isinstance(reader.node["grid"], str):
        name = reader.string("grid", "")
    sources = [key for key in ("filename", "data") if reader.has(key)]
    sources += ["grid"] if reader.has("grid") and name is None else []
    if len(sources) != 1:
        reader.fail(
            f"a gridvolume needs one of filename, grid (array) and data (array), got {len(sources)}",
            hint=" and ".join(sources),
        )
    if sources != ["filename"]:
        if reader.has("level_set"):
            reader.fail("an array is no level set of a .vdb or .nvdb file", "level_set", "leave it out")
        if name is not None:
            reader.fail(f"an array has no grid named '{name}'", "grid", "the name goes with a filename")
        if isinstance(reader.node[sources[0]], DenseGrid | SparseGrid):
            grid = cast("Grid", reader.raw(sources[0]))
            if os.path.isfile(grid.source):
                note_file(grid.source)
            return grid
        where = reader.node.place(sources[0])
        if is_labelled(reader.node[sources[0]]):
            return grid_from_labelled(reader.raw(sources[0]), where)
        return dense_from_array(reader.array(sources[0]), source=where, channels=CHANNELS)
    path, inside = find_volume(reader, "filename")
    if inside is not None and name is not None:
        reader.fail(f"the filename names an array itself, '{inside}'", "grid", "give one of them")
    name = inside if name is None else name
    return _read(reader, path, name, _read_volume)


def _read_volume(path: Path, name: str | None) -> Grid:
    """Of any format; of Mitsuba's with six channels too."""
    if name is None and volume_suffix(path) == ".vol":
        return read_vol(path, CHANNELS)
    return read_volume(path, name)


def _read(reader: Reader, path: Path, name: str | None, read: Callable[[Path, str | None], Grid]) -> Grid:
    """A grid of a file, as a fog volume where that is asked for; it is read and made once per scene."""
    grids, use = reader.library.grids, reader.string("level_set", "", USES)
    resolved = path.resolve()
    if name is None and (resolved, "density", "") in grids:
        name = "density"
    if (resolved, name, "") not in grids:
        grid = grids[resolved, name, ""] = read(path, name)
        if isinstance(grid, SparseGrid):  # which may be named elsewhere, where it is not here
            grids[resolved, grid.name, ""] = grid
    if (resolved, name, use) not in grids:
        grids[resolved, name, use] = fog_of(grids[resolved, name, ""])
    return grids[resolved, name, use]


def _sparse_volume(reader: Reader, grid: SparseGrid) -> Volume:
    """A sparse grid in the world: its box is the active box plus one sample on each side.

    One without active voxels, as the first frames of a simulation have, is 0 everywhere.
    """
    to_world = reader.transform() @ grid.index_to_world
    filter_type = reader.string("filter_type", "trilinear", FILTER_TYPES)
    if grid.active_voxels == 0 and grid.clear_outside:
        log.warning("%s: has no active voxels, and is 0 everywhere", place(grid.source, grid.name))
        reader.ignore(sanitize=bool)
        return ConstVolume((0.0,), to_world)
    return GridVolume(
        grid,
        to_world,
        grid.active_box[0] - 1.0,
        grid.active_box[1] + 1.0,
        filter_type,
        clipped=grid.clear_outside,
        source=f"{grid.source}:{grid.name}" if grid.name not in grid.source else grid.source,
        sanitize=reader.boolean("sanitize", False),
    )


def largest_value(volume: Volume) -> float:
    """Upper bound of a volume's values in every channel; NaN when it holds one."""
    if isinstance(volume, ConstVolume):
        return max(volume.value)
    if isinstance(volume.grid, DenseGrid):
        return float(volume.grid.values.max())
    parts = (volume.grid.leaf_values, volume.grid.tile_values, volume.grid.background)
    return float(max(part.max() for part in parts if part.size))


def limited(volume: Volume, maximum: float) -> Volume:
    """The volume with no value above `maximum`."""
    if isinstance(volume, ConstVolume):
        return replace(volume, value=tuple(min(value, maximum) for value in volume.value))
    sparse = ("leaf_values", "tile_values", "background")
    names = ("values",) if isinstance(volume.grid, DenseGrid) else sparse
    limits = {name: np.minimum(getattr(volume.grid, name), np.float32(maximum)) for name in names}
    return replace(volume, grid=replace(volume.grid, **limits))
