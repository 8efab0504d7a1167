"""VTK's image data (.vti) through VTK itself."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.extras import need
from clvol.errors import GRID, VolumeError
from clvol.volumes.files import TRUNCATED, open_binary
from clvol.volumes.placed import Axis, check_size, placed_grid, samples

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from clvol.volumes.grid import DenseGrid

SUFFIX = ".vti"


def read_vti(path: str | os.PathLike[str], grid: str | None = None) -> DenseGrid:
    """An array of an image's points or cells, where origin, spacing and direction place it.

    Parameters
    ----------
    grid : name of the array; needed only where there are several and none is active.

    Raises VolumeError for a missing or damaged file, an array that is not there, of other than 1 or 3
    components, OptionError without vtk.
    """
    where = str(path)
    said: list[str] = []
    xml = need("vtkmodules.vtkIOXML", f"reading {Path(path).name}", "science")
    numpy_support = need("vtkmodules.util.numpy_support", f"reading {Path(path).name}", "science")
    logger = need("vtkmodules.vtkCommonCore", f"reading {Path(path).name}", "science").vtkLogger
    with open_binary(path), _silent(logger):
        reader = xml.vtkXMLImageDataReader()

        def listen(*told: object) -> None:
            said.append(str(told[-1]).strip().splitlines()[-1].partition("): ")[2])

        listen.CallDataType = "string0"  # type: ignore[attr-defined]
        reader.AddObserver("ErrorEvent", listen)
        reader.SetFileName(where)
        reader.UpdateInformation()
        information = reader.GetOutputInformation(0)
        key = reader.GetExecutive().WHOLE_EXTENT()
        if said or not information.Has(key):
            raise VolumeError(f"cannot be read ({said[0] if said else 'no image'})", where, TRUNCATED)
        extent = [information.Get(key, n) for n in range(6)]
        check_size([extent[2 * n + 1] - extent[2 * n] + 1 for n in range(3)], where)
        reader.Update()
        if said:
            raise VolumeError(f"cannot be read ({said[0]})", where, TRUNCATED)
        return _grid(reader.GetOutput(), numpy_support.vtk_to_numpy, grid, path)


@contextmanager
def _silent(logger: Any) -> Iterator[None]:
    """VTK prints nothing of what is wrong with a file: that is raised."""
    before = logger.GetCurrentVerbosityCutoff()
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    try:
        yield
    finally:
        logger.SetStderrVerbosity(before)


def _grid(image: Any, to_numpy: Any, grid: str | None, path: str | os.PathLike[str]) -> DenseGrid:
    where, sets = str(path), (image.GetPointData(), image.GetCellData())
    names = [(data, data.GetArrayName(n)) for data in sets for n in range(data.GetNumberOfArrays())]
    listed = ", ".join(repr(name) for _, name in names) or "none"
    if grid is None:
        active = [(d, d.GetScalars().GetName()) for d in sets if d.GetScalars() is not None]
        found = names if len(names) == 1 else active[:1]
        if not found:
            raise VolumeError(f"holds {len(names)} arrays", where, f"name one by {GRID}: {listed}")
    else:
        found = [(data, name) for data, name in names if name == grid][:1]
        if not found:
            raise VolumeError(f"has no array {grid!r}", where, f"its arrays are {listed}")
    data, name = found[0]
    of_cells = data is sets[1]
    array = to_numpy(data.GetArray(name))
    extent, half = image.GetExtent(), 0.5 if of_cells else 0.0
    size = [max(extent[2 * n + 1] - extent[2 * n] + (not of_cells), 1) for n in range(3)]
    channels = array.shape[1:] or ()
    array = array.reshape(*size[::-1], *channels)
    values = samples(array.shape, array.dtype, array.__getitem__, where)
    matrix = image.GetDirectionMatrix()
    direction = np.array([[matrix.GetElement(i, j) for j in range(3)] for i in range(3)])
    spacing = np.array(image.GetSpacing())
    first = np.array(extent[::2]) + half
    origin = np.array(image.GetOrigin()) + direction @ (spacing * first)
    axes = [Axis(float(o), float(s)) for o, s in zip(origin, spacing, strict=True)]
    return placed_grid(values, axes, direction=direction, name=name or "", source=where)
