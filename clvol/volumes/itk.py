"""Medical images through SimpleITK: NIfTI, NRRD, MetaImage, and folders of DICOM slices.

Positions are ITK's: millimetres, x towards the patient's left, y to the back, z to the head (LPS), whatever
the file's own convention is.
"""

from __future__ import annotations

import gzip
import locale
import logging
import math
import re
import struct
import zlib
from contextlib import contextmanager
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from clvol.base.extras import need
from clvol.base.files import note_file
from clvol.errors import GRID, VolumeError
from clvol.volumes.files import CHUNK, TRUNCATED, open_binary
from clvol.volumes.placed import Axis, check_size, part_of, placed_grid, samples, split_indices

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from clvol.volumes.grid import DenseGrid

log = logging.getLogger("clvol")

SUFFIXES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm")
"""Files that are read."""
UNEVEN = 0.01
"""Share of their mean by which the distances of slices may differ before a warning says so."""
_MILLIMETRES = "mm"
_HEADER = 1 << 20
_DATA_FILE = re.compile(r"(?:ElementDataFile\s*=|data ?file:)\s*(.+)", re.IGNORECASE)


def read_itk(path: str | os.PathLike[str], grid: str | None = None) -> DenseGrid:
    """An image of three axes, of 1 or 3 components, where its header places it.

    Parameters
    ----------
    path : a NIfTI, NRRD, MetaImage or single DICOM file.
    grid : of images of four axes, as over time, "[3]" is the fourth volume.

    Raises VolumeError for a missing or damaged file and images of other axes, OptionError without SimpleITK.
    """
    sitk, where = _simpleitk(path), str(path)
    with open_binary(path), _locale_kept():  # a regular file, there and not empty
        name, indices = split_indices(grid)
        if name is not None:
            raise VolumeError(f"has no grid named {name!r}: it holds one image", where, "leave the name out")
        reader = sitk.ImageFileReader()
        reader.SetFileName(where)
        size, channels = _header(sitk, reader, where)
        if ".nii" in "".join(Path(path).suffixes[-2:]).lower():
            _check_nifti(path)
        shape = tuple(size[::-1]) if len(size) > 2 else (1, *size[::-1])
        part = part_of(shape, indices, False, where, "t, z, y, x")
        check_size((*shape[-3:], channels), where)
        if part:
            reader.SetExtractIndex([0, 0, 0, part[0]])
            reader.SetExtractSize([*size[:3], 0])
        for file in _data_files(Path(path)):
            note_file(file)
        return _grid(sitk, reader, path)


def _data_files(path: Path) -> Iterator[Path]:
    """The files beside a header of MetaImage or NRRD that have its samples."""
    if path.suffix.lower() not in (".mhd", ".nhdr"):
        return
    with open_binary(path) as file:
        lines = file.read(_HEADER).decode("latin-1").splitlines()
    for number, line in enumerate(lines):
        if found := _DATA_FILE.fullmatch(line):
            name = found[1].split("%")[0]  # of numbered files, all that begin so
            names = lines[number + 1 :] if name.split(" ")[0] == "LIST" else [name]
            for one in filter(None, map(str.strip, names)):
                yield from path.parent.glob(f"{escape(one)}*" if "%" in found[1] else escape(one))


def read_dicom(folder: str | os.PathLike[str], grid: str | None = None) -> DenseGrid:
    """The slices of one series in a folder, in their order along it.

    Parameters
    ----------
    grid : the series' identifier, or its number; needed only where the folder holds several.

    Raises VolumeError for a folder without DICOM slices, several series, damaged files, OptionError without
    SimpleITK.
    """
    with _locale_kept():
        return _read_series(_simpleitk(folder), folder, grid)


def _read_series(sitk: Any, folder: str | os.PathLike[str], grid: str | None) -> DenseGrid:
    where = str(folder)
    files = sitk.ImageSeriesReader.GetGDCMSeriesFileNames(where, _series(sitk, where, grid))
    positions, area, channels = [], 0, 1
    for file in files:
        with open_binary(file):
            reader = sitk.ImageFileReader()
            reader.SetFileName(file)
            size, channels = _header(sitk, reader, file)
            area = math.prod(size[:2])
            positions.append(reader.GetOrigin())
    check_size((len(files), area, channels), where)
    _warn_of_uneven(np.array(positions), where)
    series = sitk.ImageSeriesReader()
    series.SetFileNames(files)
    return _grid(sitk, series, folder)


def _simpleitk(path: str | os.PathLike[str]) -> Any:
    sitk = need("SimpleITK", f"reading {Path(path).name}", "science")
    sitk.ProcessObject.SetGlobalWarningDisplay(False)  # what it says of broken files is in its exceptions
    return sitk


@contextmanager
def _locale_kept() -> Iterator[None]:
    """ITK may leave another locale behind, and Python would then write ASCII."""
    before = locale.setlocale(locale.LC_ALL)
    try:
        yield
    finally:
        locale.setlocale(locale.LC_ALL, before)


def _series(sitk: Any, where: str, grid: str | None) -> str:
    """The identifier of the series that `grid` names, or of the only one."""
    try:
        series: list[str] = list(sitk.ImageSeriesReader.GetGDCMSeriesIDs(where))
    except RuntimeError as error:
        _damaged(error, where)
    if not series:
        raise VolumeError(
            "is a folder without DICOM slices", where, "give the folder that the .dcm files lie in"
        )
    listed = ", ".join(f"{n}: {identifier}" for n, identifier in enumerate(series))
    if grid is None:
        if len(series) > 1:
            hint = f"name one by {GRID}, by number or name: {listed}"
            raise VolumeError(f"holds {len(series)} DICOM series", where, hint)
        return series[0]
    if grid in series:
        return grid
    if not grid.isdecimal() or int(grid) >= len(series):
        raise VolumeError(f"has no DICOM series {grid!r}", where, f"it has {listed}")
    return series[int(grid)]


def _header(sitk: Any, reader: Any, where: str) -> tuple[list[int], int]:
    """Samples along x, y, z, ..., and components, of an image that can be a grid."""
    try:
        reader.ReadImageInformation()
        size, channels = list(reader.GetSize()), int(reader.GetNumberOfComponents())
        kind = sitk.GetPixelIDValueAsString(reader.GetPixelID())
    except RuntimeError as error:
        _damaged(error, where)
    if "complex" in kind:
        raise VolumeError(f"holds samples of {kind}, real numbers can be read", where)
    if len(size) not in (2, 3, 4) or channels not in (1, 3):
        what = f"is an image of {len(size)} axes and {channels} components"
        raise VolumeError(f"{what}; 3 axes and 1 or 3 components can be read", where)
    return size, channels


def _grid(sitk: Any, reader: Any, path: str | os.PathLike[str]) -> DenseGrid:
    where = str(path)
    try:
        image = reader.Execute()
    except RuntimeError as error:
        _damaged(error, where)
    if image.GetDimension() == 2:
        image = sitk.JoinSeries(image)
    view = sitk.GetArrayViewFromImage(image)
    values = samples(view.shape, view.dtype, view.__getitem__, where)
    axes = [Axis(*numbers) for numbers in zip(image.GetOrigin(), image.GetSpacing(), strict=True)]
    direction = np.array(image.GetDirection(), np.float64).reshape(3, 3)
    name = Path(path).name.split(".")[0]
    return placed_grid(values, axes, direction=direction, unit=_MILLIMETRES, name=name, source=where)


def _damaged(error: RuntimeError, where: str) -> NoReturn:
    """Raise a VolumeError with the last line of what ITK says that is about the file, which is the reason."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    reason = [line for line in lines if not line.startswith("Reason:")] or [str(error)]
    said = re.sub(r"^(ITK|sitk::)\s*ERROR: (\w+\(\w+\): )?", "", reason[-1])
    raise VolumeError(f"cannot be read ({said})", where, TRUNCATED) from None


def _check_nifti(path: str | os.PathLike[str]) -> None:
    """VolumeError for a NIfTI file that ends too soon: ITK has zeros for what is missing."""
    where = str(path)
    try:
        with gzip.open(path) if str(path).lower().endswith(".gz") else open(path, "rb") as file:
            start = file.read(540)
            order = "<" if start[:2] in (b"\x5c\x01", b"\x1c\x02") else ">"
            if start[:4] in (b"\x5c\x01\0\0", b"\0\0\x01\x5c"):
                dims = struct.unpack_from(f"{order}8h", start, 40)
                bits, offset = struct.unpack_from(f"{order}h", start, 72)[0], 108
                first = struct.unpack_from(f"{order}f", start, offset)[0]
            else:
                dims = struct.unpack_from(f"{order}8q", start, 16)
                bits, first = struct.unpack_from(f"{order}h", start, 14)[0], 0
                first = struct.unpack_from(f"{order}q", start, 168)[0]
            needed = first + math.prod(dims[1 : 1 + max(min(dims[0], 7), 0)]) * bits / 8
            there = len(start)
            while there < needed and (chunk := file.read(CHUNK)):
                there += len(chunk)
    except (OSError, EOFError, zlib.error, struct.error) as error:
        raise VolumeError(f"cannot be read ({error})", where, TRUNCATED) from None
    if there < needed:
        raise VolumeError(f"its samples need {needed:.0f} bytes, the file has {there}", where, TRUNCATED)


def _warn_of_uneven(positions: np.ndarray, where: str) -> None:
    """Say where the slices of a series are not evenly spaced, as where one is missing."""
    if len(positions) < 3:
        return
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    if np.ptp(steps) > UNEVEN * steps.mean():
        log.warning(
            "%s: its %d slices are %g to %g mm apart, and taken as evenly spaced; is one missing?",
            *(where, len(positions), steps.min(), steps.max()),
        )
