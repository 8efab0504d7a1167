"""Arrays in HDF5, NetCDF 4 and Zarr: one of many, named by its path inside, ``scan.h5:/entry/density``."""

from __future__ import annotations

import base64
import logging
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need
from clvol.errors import VolumeError
from clvol.volumes.files import TRUNCATED, open_binary
from clvol.volumes.placed import Axis, axis_of, part_of, placed_grid, samples, split_indices

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping, Sequence

    from clvol.volumes.grid import DenseGrid

log = logging.getLogger("clvol")

HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf", ".he5", ".nc", ".nc4")
ZARR_SUFFIX = ".zarr"
MOST_LISTED = 20
_ZARR_FILES = ("zarr.json", ".zgroup", ".zarray")


def read_hdf5(path: str | os.PathLike[str], grid: str | None = None) -> DenseGrid:
    """An array of an HDF5 or NetCDF 4 file, placed by its dimension scales or `element_size_um`, if any.

    Parameters
    ----------
    grid : path of the array inside, needed only where several have three axes; "density[3]" is a part of one
        that has more.

    Raises VolumeError for a missing or damaged file, an array that is not there or no volume, OptionError
    without h5py.
    """
    h5py = need("h5py", f"reading {Path(path).name}", "science")
    with open_binary(path), _readable(path), h5py.File(path, "r") as file:
        arrays = _datasets(h5py, file)
        name, indices = _choose(arrays, grid, str(path))
        return _read(arrays[name], indices, _hdf5_axes(arrays[name], str(path)), name, path)


def read_zarr(path: str | os.PathLike[str], grid: str | None = None) -> DenseGrid:
    """An array of a Zarr folder, placed by xarray's coordinates or OME's scales if it has them.

    `grid` and errors are those of `read_hdf5`, without zarr OptionError.
    """
    zarr, where = need("zarr", f"reading {Path(path).name}", "science"), str(path)
    with _readable(path):
        root = zarr.open(where, mode="r")
        arrays = _members(zarr, root)
        name, indices = _choose(arrays, grid, where)
        return _read(arrays[name], indices, _zarr_axes(root, arrays, name, where), name, path)


def list_hdf5(path: str | os.PathLike[str]) -> list[str]:
    """Names of the arrays of an HDF5 file that have three axes or more; errors as `read_hdf5`."""
    h5py = need("h5py", f"reading {Path(path).name}", "science")
    with open_binary(path), _readable(path), h5py.File(path, "r") as file:
        return _volumes(_datasets(h5py, file))


def list_zarr(path: str | os.PathLike[str]) -> list[str]:
    """Names of the arrays of a Zarr folder that have three axes or more; errors as `read_zarr`."""
    zarr = need("zarr", f"reading {Path(path).name}", "science")
    with _readable(path):
        return _volumes(_members(zarr, zarr.open(str(path), mode="r")))


def _volumes(arrays: Mapping[str, Any]) -> list[str]:
    return [f"/{name}" for name, array in arrays.items() if len(array.shape) >= 3]


def _datasets(h5py: Any, file: Any) -> dict[str, Any]:
    """The arrays of an HDF5 file by their paths, without the slash before."""
    arrays: dict[str, Any] = {}

    def collect(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            arrays[name] = item

    file.visititems(collect)
    return arrays


def _members(zarr: Any, root: Any) -> dict[str, Any]:
    """The arrays of a Zarr group likewise; one that stands alone has no name."""
    if isinstance(root, zarr.Array):
        return {"": root}
    return {name: item for name, item in root.members(max_depth=None) if isinstance(item, zarr.Array)}


@contextmanager
def _readable(path: str | os.PathLike[str]) -> Iterator[None]:
    """What libraries raise of broken files, anything they happen to meet, as a VolumeError."""
    try:
        yield
    except VolumeError:
        raise
    except Exception as error:
        raise VolumeError(f"cannot be read ({error})", str(path), TRUNCATED) from None


def is_zarr(folder: Path) -> bool:
    """Whether a folder is a Zarr group or array."""
    return any((folder / name).is_file() for name in _ZARR_FILES)


def _choose(arrays: Mapping[str, Any], grid: str | None, where: str) -> tuple[str, tuple[int, ...]]:
    """Name of the array that `grid` names, or of the only volume, and the indices of its part."""
    named, indices = split_indices(grid)
    volumes = [name for name, array in arrays.items() if len(array.shape) >= 3]
    listed = ", ".join(f"/{name} {tuple(arrays[name].shape)}" for name in volumes[:MOST_LISTED]) or "none"
    if named is None or not named.strip("/"):
        if len(volumes) != 1:
            hint = f"name one, as {where}:/{volumes[0]}; it has {listed}" if volumes else ""
            raise VolumeError(f"holds {len(volumes)} arrays of three axes or more", where, hint)
        return volumes[0], indices
    if named.strip("/") not in arrays:
        raise VolumeError(f"has no array {named!r}", where, f"its arrays of three axes or more: {listed}")
    return named.strip("/"), indices


Placed = tuple[list[Axis], str]
"""Axes x, y, z and their unit."""


def _read(
    array: Any, indices: tuple[int, ...], placed: Placed, name: str, path: str | os.PathLike[str]
) -> DenseGrid:
    where = f"{path}:/{name}"
    shape, dtype = tuple(array.shape), np.dtype(array.dtype)
    channels = len(shape) > 3 and shape[-1] in (1, 3) and len(shape) - 4 == len(indices)
    part = part_of(shape, indices, channels, where)
    left = shape[len(part) :]
    values = samples(left, dtype, lambda planes: array[(*part, planes)], where)
    _unpack(values, dict(array.attrs), dtype, where)
    axes, unit = placed
    return placed_grid(values, axes, unit=unit, name=name, source=where)


def _unpack(values: np.ndarray, attributes: dict[str, Any], dtype: np.dtype, where: str) -> None:
    """What the attributes of the CF conventions say of packed values, in place."""
    missing = [attributes[name] for name in ("_FillValue", "missing_value") if name in attributes]
    filled = np.zeros(values.shape, bool)
    for value in missing:
        filled |= values == _missing(value, dtype)
    if "scale_factor" in attributes:
        values *= np.float32(np.asarray(attributes["scale_factor"]).reshape(()))
    if "add_offset" in attributes:
        values += np.float32(np.asarray(attributes["add_offset"]).reshape(()))
    if filled.any():
        values[filled] = 0
        log.warning("%s: %d of %d samples are missing, and taken as 0", where, filled.sum(), values.size)


def _missing(value: Any, dtype: np.dtype) -> np.float32:
    """The float32 of a value that stands for none; xarray writes those of floats to Zarr in base 64."""
    if isinstance(value, str):
        return np.float32(np.frombuffer(base64.b64decode(value), dtype.newbyteorder("<"))[0])
    return np.float32(np.asarray(value).reshape(()).astype(dtype))


def _hdf5_axes(array: Any, where: str) -> Placed:
    """Where the last three axes lie: by dimension scales, or by what microscopes write."""
    if "element_size_um" in array.attrs:
        sizes = np.asarray(array.attrs["element_size_um"], np.float64).reshape(-1)
        if sizes.size == 3:
            return [Axis(0.0, float(size)) for size in sizes[::-1]], "µm"
    first = len(array.shape) - 3
    if first < 0:
        return [Axis()] * 3, ""
    scales = [array.dims[axis] for axis in range(first, len(array.shape))]
    coordinates = [scale[0] if len(scale) else None for scale in scales]
    return _coordinate_axes(array.shape[first:], coordinates, where)


def _coordinate_axes(shape: Sequence[int], coordinates: Sequence[Any], where: str) -> Placed:
    """Axes x, y, z from arrays of coordinates along z, y, x, or None each."""
    axes, units = [], []
    for size, along, what in zip(shape, coordinates, "zyx", strict=True):
        if along is None or tuple(along.shape) != (size,):
            axes.append(Axis())
            continue
        axes.append(axis_of(np.asarray(along[:]), what, where))
        unit = along.attrs.get("units", "")
        units.append(unit.decode() if isinstance(unit, bytes) else str(unit))
    return axes[::-1], units[0] if units and len(set(units)) == 1 else ""


def _zarr_axes(root: Any, arrays: Mapping[str, Any], name: str, where: str) -> Placed:
    """Where the last three axes lie: by xarray's names of dimensions, or OME's multiscales."""
    array, first = arrays[name], len(arrays[name].shape) - 3
    folder = name.rpartition("/")[0]
    dimensions = getattr(array.metadata, "dimension_names", None) or array.attrs.get("_ARRAY_DIMENSIONS")
    if dimensions and first >= 0:
        names = [f"{folder}/{dimension}".strip("/") for dimension in dimensions[first:]]
        found = [arrays.get(each) for each in names]
        if any(each is not None for each in found):
            return _coordinate_axes(array.shape[first:], found, where)
    group = root[folder] if folder else root
    attributes = dict(getattr(group, "attrs", {}))
    for scales in attributes.get("ome", attributes).get("multiscales", ()):
        for stored in scales.get("datasets", ()):
            if stored.get("path") == name.rpartition("/")[2]:
                return _ome_axes(stored, scales)
    return [Axis()] * 3, ""


def _ome_axes(stored: Mapping[str, Any], scales: Mapping[str, Any]) -> Placed:
    steps, origins = [1.0, 1.0, 1.0], [0.0, 0.0, 0.0]
    for change in stored.get("coordinateTransformations", ()):
        if change.get("type") == "scale":
            steps = [float(number) for number in change["scale"]][-3:]
        elif change.get("type") == "translation":
            origins = [float(number) for number in change["translation"]][-3:]
    last = (scales.get("axes") or [{}])[-1]
    unit = str(last.get("unit", "")) if isinstance(last, dict) else ""
    axes = [Axis(*numbers) for numbers in zip(origins[::-1], steps[::-1], strict=True)]
    return axes, {"micrometer": "µm", "millimeter": "mm", "nanometer": "nm"}.get(unit, unit)
