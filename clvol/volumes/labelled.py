"""xarray's DataArray as a grid that lies where its coordinates say."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from clvol.errors import VolumeError
from clvol.volumes.numpy_files import dense_from_array
from clvol.volumes.placed import Axis, axis_of, placed_grid

if TYPE_CHECKING:
    from clvol.volumes.grid import DenseGrid

NAMES = ({"x", "lon", "longitude", "i"}, {"y", "lat", "latitude", "j"}, {"z", "lev", "level", "height", "k"})
"""How dimensions along x, y and z may be called; they are else taken in the order z, y, x."""


def is_labelled(value: object) -> bool:
    """Whether a value is a DataArray, or what looks like one."""
    return all(hasattr(value, name) for name in ("dims", "coords", "values", "transpose"))


def grid_from_labelled(array: Any, source: str = "") -> DenseGrid:
    """An xarray.DataArray where its coordinates place it: a dimension without has voxels of edge 1.

    Three dimensions, in any order where they are called x, y and z, else [z, y, x]; and perhaps a last one of
    1 or 3 channels.  Coordinates that fall are turned round.

    Raises VolumeError for other dimensions, and coordinates that are unevenly spaced.
    """
    where = source or str(array.name or "DataArray")
    dims = [str(dim) for dim in array.dims]
    if len(dims) not in (3, 4):
        raise VolumeError(
            f"a DataArray of {len(dims)} dimensions ({', '.join(dims)}) is not supported",
            where,
            "choose three: array.isel(time=0)",
        )
    order = _order(dims)
    array = array.transpose(*(array.dims[n] for n in order))
    grid = dense_from_array(array.values, str(array.name or ""), where)
    axes, units = [], []
    for dim in array.dims[2::-1]:
        if dim not in array.coords or array.coords[dim].ndim != 1:
            axes.append(Axis())
            continue
        axes.append(axis_of(array.coords[dim].values, str(dim), where))
        units.append(str(array.coords[dim].attrs.get("units", "")))
    unit = units[0] if units and len(set(units)) == 1 else ""
    return placed_grid(grid.values, axes, unit=unit, name=grid.name, source=where)


def _order(dims: list[str]) -> list[int]:
    """Positions of the dimensions as [z, y, x] or [z, y, x, channel]."""
    found = [next((n for n, dim in enumerate(dims) if dim.lower() in names), -1) for names in NAMES]
    if -1 in found or len(set(found)) < 3:
        return list(range(len(dims)))
    return [*found[::-1], *(n for n in range(len(dims)) if n not in found)]
