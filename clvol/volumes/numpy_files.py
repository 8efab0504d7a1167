"""NumPy's .npy and .npz files, and arrays in memory, as dense grids on the unit cube."""

from __future__ import annotations

import logging
import math
import os
import re
import struct
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from clvol.base.masks import as_array, masked_count
from clvol.errors import GRID, VolumeError
from clvol.volumes.files import CHUNK, MAX_BYTES, TRUNCATED, allocate, fill, open_binary, place
from clvol.volumes.grid import DenseGrid
from clvol.volumes.narrowing import Narrowing

if TYPE_CHECKING:
    from io import BufferedIOBase, BufferedReader

    from numpy.typing import ArrayLike

log = logging.getLogger("clvol")

NPY_MAGIC = b"\x93NUMPY"
# NumPy's own limit for headers of plain arrays.
LONGEST_HEADER = 10_000
# Deflate cannot do better: a member that claims more is a bomb or damaged.
DEFLATE_RATIO = 1032
ZIP_ERRORS = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, ValueError, RuntimeError)


def dense_from_array(
    array: ArrayLike, name: str = "", source: str = "", channels: tuple[int, ...] = (1, 3)
) -> DenseGrid:
    """An array as a grid on the unit cube.

    Parameters
    ----------
    array : array-like [z, y, x] or [z, y, x, channel] of integers, booleans or real floats, 1 or 3
        channels.  It is copied, as float32, so that what is done to it later does not reach the grid.
        Masked samples have no value, and become 0, which a warning counts.
    name, source : what error messages call it.
    channels : numbers of them that are taken.

    Raises VolumeError for other shapes and types.
    """
    where = place(source, name)
    try:
        given = as_array(array)
    except (TypeError, ValueError) as error:
        raise VolumeError(f"is not an array ({error})", where) from None
    check_layout(given.dtype, given.shape, where, channels)
    values, narrowed = allocate(given.shape, np.float32, where), Narrowing(where)
    masked = masked_count(given)
    planes = max(CHUNK // (given.dtype.itemsize * math.prod(given.shape[1:])), 1)
    for first in range(0, len(given), planes):
        part = given[first : first + planes]
        values[first : first + planes] = narrowed(np.ma.filled(part, 0) if masked else np.ma.getdata(part))
    narrowed.check()
    if masked:
        log.warning("%s: %d of %d samples are masked, and taken as 0", where, masked, values.size)
    return _grid(values, name, source)


def _grid(values: np.ndarray, name: str, source: str) -> DenseGrid:
    """Samples that nobody else holds as a grid on the unit cube."""
    values = values[..., None] if values.ndim == 3 else values
    values.flags.writeable = False
    return DenseGrid(values, np.array([[0, 0, 0], [1, 1, 1]], np.float64), name, source)


def check_layout(
    dtype: np.dtype, shape: tuple[int, ...], where: str, channels: tuple[int, ...] = (1, 3)
) -> None:
    """VolumeError unless an array can be a grid: real numbers, [z, y, x] or [z, y, x, 1 or 3], not empty."""
    if dtype.kind not in "biuf":
        raise VolumeError(f"an array of {dtype} is not supported, real numbers are", where)
    if len(shape) not in (3, 4):
        axes = f"an array of {len(shape)} axes, shape {shape}, is not supported"
        hint = "give it the axes [z, y, x] or [z, y, x, channel]"
        if len(shape) == 5:
            hint += "; of (t, z, y, x, channel) one time is array[0]"
        raise VolumeError(axes, where, hint)
    if len(shape) == 4 and shape[3] not in channels:
        hint = "if the axes are (t, z, y, x), give one time of it, as array[0]; of others one array [z, y, x]"
        if shape[0] in (1, 3):
            hint = "put the channels last: numpy.moveaxis(array, 0, -1)"
        last = f"an array of shape {shape} is no [z, y, x, channel]: the last axis has 1 or 3 channels"
        raise VolumeError(f"{last}, not {shape[3]}", where, hint)
    if 0 in shape:
        raise VolumeError(f"an array of shape {shape} has no samples", where)


def read_numpy(
    path: str | os.PathLike[str], grid: str | None = None, *, max_bytes: int = MAX_BYTES
) -> DenseGrid:
    """A .npy file, or one array of a .npz file, as a grid on the unit cube.

    Parameters
    ----------
    path : a .npy or a .npz file.
    grid : which array of a .npz, needed only where there are several.
    max_bytes : what the samples may take in memory, where the file does not store them as they are kept,
        C-order float32.

    Raises VolumeError for a missing or damaged file, objects (pickles are never loaded), arrays that
    `dense_from_array` refuses, and more than `max_bytes`.
    """
    with open_binary(path) as file:
        start = file.read(len(NPY_MAGIC))
        file.seek(0)
        if start == NPY_MAGIC:
            if grid is not None:
                raise VolumeError(f"a .npy file has no array named {grid!r}", str(path), "leave the name out")
            return _read_npy(file, path, max_bytes)
        if not start.startswith(b"PK"):
            raise VolumeError("is neither a .npy nor a .npz file", str(path))
        return _read_npz(file, path, grid, max_bytes)


def _read_npy(file: BufferedReader, path: str | os.PathLike[str], max_bytes: int) -> DenseGrid:
    where, name = str(path), Path(path).stem
    dtype, shape, fortran = _read_header(file, where)
    available = os.fstat(file.fileno()).st_size - file.tell()
    count = math.prod(shape)
    if count * dtype.itemsize > available:
        raise VolumeError(
            f"{count} samples of {dtype} need {count * dtype.itemsize} bytes, the file has {available}",
            where,
            TRUNCATED,
        )
    if fortran or dtype != np.float32:
        _check_memory(4 * count, max_bytes, where)
    return _grid(_read_samples(file, dtype, shape, fortran, where), name, where)


def _read_npz(
    file: BufferedReader, path: str | os.PathLike[str], grid: str | None, max_bytes: int
) -> DenseGrid:
    where, size = str(path), os.fstat(file.fileno()).st_size
    try:
        with zipfile.ZipFile(file) as archive:
            members = {m.filename.removesuffix(".npy"): m for m in archive.infolist()}
            name = _choose_array(list(members), grid, where)
            where = place(where, name)
            member = members[name]
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise VolumeError(f"compression method {member.compress_type} is not NumPy's", where)
            if not 0 <= member.compress_size <= size or member.file_size > DEFLATE_RATIO * size:
                raise VolumeError(
                    f"{member.file_size} bytes stored in {member.compress_size} are impossible "
                    f"in a file of {size}",
                    where,
                    TRUNCATED,
                )
            with archive.open(member) as data:
                values = _read_member(cast("zipfile.ZipExtFile", data), member, where, max_bytes)
    except ZIP_ERRORS as error:
        raise VolumeError(f"the archive is damaged ({error})", where, TRUNCATED) from None
    return _grid(values, name, str(path))


def _choose_array(names: list[str], grid: str | None, where: str) -> str:
    listed = ", ".join(map(repr, names)) or "none"
    if grid is None and len(names) != 1:
        raise VolumeError(f"holds {len(names)} arrays", where, f"name one by {GRID}: {listed}")
    if grid is not None and grid not in names:
        raise VolumeError(f"has no array {grid!r}", where, f"its arrays are {listed}")
    return names[0] if grid is None else grid


def _read_member(data: BufferedIOBase, member: zipfile.ZipInfo, where: str, max_bytes: int) -> np.ndarray:
    dtype, shape, fortran = _read_header(data, where)
    count = math.prod(shape)
    nbytes = count * dtype.itemsize
    if data.tell() + nbytes > member.file_size:
        raise VolumeError(
            f"{count} samples of {dtype} need {nbytes} bytes, the array has {member.file_size - data.tell()}",
            where,
            TRUNCATED,
        )
    _check_memory(4 * count, max_bytes, where)
    return _read_samples(data, dtype, shape, fortran, where)


def _read_samples(
    file: BufferedIOBase, dtype: np.dtype, shape: tuple[int, ...], fortran: bool, where: str
) -> np.ndarray:
    """The array at the file's position as C-order float32, some planes of another type or order at a time."""
    values = allocate(shape, np.float32, where)
    if dtype == np.float32 and not fortran:
        fill(values, file, where)
        return values
    target, narrowed = values.T if fortran else values, Narrowing(where)
    planes = max(CHUNK // (dtype.itemsize * math.prod(target.shape[1:])), 1)
    for first in range(0, len(target), planes):
        part = target[first : first + planes]
        stored = np.empty(part.shape, dtype)
        fill(stored, file, where)
        part[...] = narrowed(stored)
    narrowed.check()
    return values


def _check_memory(nbytes: int, max_bytes: int, where: str) -> None:
    if nbytes > max_bytes:
        raise VolumeError(
            f"{nbytes} bytes of memory are needed, the limit is {max_bytes}",
            where,
            "store it as a C-order float32 .npy",
        )


def _read_header(file: BufferedIOBase, where: str) -> tuple[np.dtype, tuple[int, ...], bool]:
    """dtype, shape, and whether the order is Fortran's; the file then stands at the samples.

    The header is the text of a Python dictionary.  Only the three plain fields NumPy writes are
    looked for; nothing is evaluated.
    """
    start = file.read(8)
    if len(start) < 8 or not start.startswith(NPY_MAGIC):
        raise VolumeError("is not a NumPy array (wrong magic number)", where, TRUNCATED)
    if start[6] not in (1, 2, 3):
        raise VolumeError(f"version {start[6]} of NumPy's format is not supported", where)
    width = 2 if start[6] == 1 else 4
    length = int.from_bytes(file.read(width), "little")
    header = file.read(min(length, LONGEST_HEADER)).decode("latin-1")
    descr = re.search(r"'descr': *'([<>|=]?[biuf]\d{1,2})'", header)
    order = re.search(r"'fortran_order': *(True|False)", header)
    shape = re.search(r"'shape': *\(([\d, ]{1,400})\)", header)
    if len(header) != length or not order or "'descr'" not in header:
        raise VolumeError("its NumPy header is damaged", where, TRUNCATED)
    if not descr:
        raise VolumeError(
            "does not hold real numbers", where, "convert objects and records to one real array"
        )
    if not shape:
        raise VolumeError("its shape is not that of an array of samples", where)
    try:
        dtype = np.dtype(descr[1])
    except TypeError as error:
        raise VolumeError(f"its NumPy header is damaged ({error})", where, TRUNCATED) from None
    sizes = tuple(int(size) for size in re.findall(r"\d+", shape[1]))
    check_layout(dtype, sizes, where)
    return dtype, sizes, order[1] == "True"
