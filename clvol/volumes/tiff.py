"""Stacks of TIFF pictures through tifffile, ImageJ's and OME's spacing included."""

from __future__ import annotations

import logging
import os
import re
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need
from clvol.base.files import note_file
from clvol.errors import VolumeError
from clvol.volumes.files import TRUNCATED, open_binary
from clvol.volumes.placed import Axis, check_size, part_of, placed_grid, samples, split_indices

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.volumes.grid import DenseGrid

log = logging.getLogger("clvol")

SUFFIXES = (".tif", ".tiff")
"""Files that are read."""
_PICTURE = "put the slices into one file, a page each; a scene names a picture in an envmap or a bitmap"


def read_tiff(path: str | os.PathLike[str], grid: str | None = None) -> DenseGrid:
    """A stack of pictures as a grid [z, y, x], grey or rgb.

    The spacing is ImageJ's or OME's where the file has either, else voxels have edges of 1.

    Parameters
    ----------
    grid : of stacks over time or in several channels, "[1]" or "[4,0]" is one volume.

    Raises VolumeError for a missing or damaged file and other axes, OptionError without tifffile.
    """
    where = str(path)
    tifffile = need("tifffile", f"reading {Path(path).name}", "science")
    name, indices = split_indices(grid)
    if name is not None:
        raise VolumeError(f"has no grid named {name!r}: it holds one stack", where, "leave the name out")
    with open_binary(path) as file, _complaints() as complaints:
        try:
            with tifffile.TiffFile(where) as tiff:
                stack = _stack(tiff, indices, path, os.fstat(file.fileno()).st_size)
        except VolumeError:
            raise
        except Exception as error:  # of broken files it raises what it happens to meet
            raise VolumeError(f"cannot be read ({error})", where, TRUNCATED) from None
        if complaints:
            raise VolumeError(f"cannot be read ({complaints[0]})", where, TRUNCATED)
        return stack


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """What tifffile logs as errors: it returns what it has of a broken file."""
    heard: list[str] = []
    logger, handler = logging.getLogger("tifffile"), logging.Handler(logging.ERROR)
    handler.emit = lambda record: heard.append(record.getMessage())  # type: ignore[method-assign]
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield heard
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates


def _stack(tiff: Any, indices: tuple[int, ...], path: str | os.PathLike[str], size: int) -> DenseGrid:
    where = str(path)
    if not tiff.series:
        raise VolumeError("holds no pictures", where, TRUNCATED)
    alike = [
        each
        for each in tiff.series
        if (each.shape, each.dtype) == (tiff.series[0].shape, tiff.series[0].dtype)
    ]
    if len(alike) < len(tiff.series):
        log.warning("%s: %d pictures of another size are left out", where, len(tiff.series) - len(alike))
    if len(alike[0].shape) > 2:
        alike = alike[:1]
    for page in (page for each in alike for page in each.pages if page is not None):
        note_file(page.parent.filehandle.path)  # OME puts the pictures of a stack into several files
        ends = zip(page.dataoffsets, page.databytecounts, strict=True)
        if any(start + count > size for start, count in ends):
            raise VolumeError("its pictures reach beyond its end", where, TRUNCATED)
    axes, shape = alike[0].axes, tuple(alike[0].shape)
    check_size((len(alike), *shape), where)
    array = alike[0].asarray()
    if len(alike) > 1:  # pages that were written one by one
        array, axes = np.stack([array, *(each.asarray() for each in alike[1:])]), f"Z{axes}"
    rgb = axes.endswith("S") and array.shape[-1] in (3, 4)
    if rgb:
        array = array[..., :3]  # without alpha
    if "Z" in axes and axes.index("Z") != len(axes) - 3 - rgb:
        array = _z_last(array, axes.index("Z"), rgb)
        axes = axes.replace("Z", "")
        axes = f"{axes[: len(axes) - 2 - rgb]}Z{axes[len(axes) - 2 - rgb :]}"
    if array.ndim == 2 + rgb:
        pixels = f"{array.shape[1]} x {array.shape[0]} pixels"
        raise VolumeError(f"is one picture, of {pixels}, and a volume is a stack of them", where, _PICTURE)
    array = array[part_of(array.shape, indices, rgb, where, ", ".join(axes.lower()))]
    values = samples(array.shape, array.dtype, array.__getitem__, where)
    spacing, unit = _spacing(tiff)
    placed = [Axis(0.0, step) for step in spacing]
    return placed_grid(values, placed, unit=unit, name=Path(path).stem, source=where)


def _z_last(array: Any, z: int, rgb: bool) -> Any:
    """The array with its axis z just before y and x."""
    order = [axis for axis in range(array.ndim) if axis != z]
    order.insert(array.ndim - 3 - rgb, z)
    return array.transpose(order)


def _spacing(tiff: Any) -> tuple[tuple[float, float, float], str]:
    """Distances of voxels along x, y, z, and their unit; 1 and none where the file does not say."""
    if tiff.is_ome and tiff.ome_metadata:
        found = {
            axis: re.search(rf'\bPhysicalSize{axis}="([0-9.eE+-]+)"', tiff.ome_metadata) for axis in "XYZ"
        }
        unit = re.search(r'\bPhysicalSizeXUnit="([^"]{1,20})"', tiff.ome_metadata)
        x, y, z = (float(match[1]) if match else 1.0 for match in found.values())
        return (x, y, z), (unit[1] if unit else "µm") if any(found.values()) else ""
    if tiff.is_imagej and tiff.imagej_metadata:
        tags, metadata = tiff.pages[0].tags, tiff.imagej_metadata
        said = str(metadata.get("unit", ""))
        steps = [
            tags[name].value[1] / tags[name].value[0] if name in tags and tags[name].value[0] else 1.0
            for name in ("XResolution", "YResolution")
        ]
        named = {"micron": "µm", "microns": "µm", "um": "µm", r"\u00B5m": "µm", "pixel": ""}.get(said, said)
        return (steps[0], steps[1], float(metadata.get("spacing", 1.0))), named
    return (1.0, 1.0, 1.0), ""
