"""Mitsuba's .vol files: a 48-byte header, then float32 samples with x fastest."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np

from clvol.base.masks import masked_count
from clvol.base.output_files import replacing
from clvol.errors import VolumeError
from clvol.volumes.files import TRUNCATED, allocate, fill, open_binary
from clvol.volumes.grid import DenseGrid

# "VOL", version, type of the samples, nx ny nz channels, box.
HEADER = struct.Struct("<3sB5i6f")
VERSION, FLOAT32 = 3, 1


def read_vol(path: str | os.PathLike[str], channels_taken: tuple[int, ...] = (1, 3)) -> DenseGrid:
    """A .vol file (version 3, float32, 1 or 3 channels, or others that are taken).

    Bytes after the samples are ignored, as Mitsuba does.  Raises VolumeError for a missing, damaged
    or truncated file, other versions and types, and other numbers of channels.
    """
    where = str(path)
    with open_binary(path) as file:
        size = os.fstat(file.fileno()).st_size
        header = file.read(HEADER.size)
        if not header.startswith(b"VOL"):
            raise VolumeError("is not a Mitsuba volume (does not start with VOL)", where)
        if len(header) < HEADER.size:
            raise VolumeError(f"its header takes {HEADER.size} bytes, the file has {size}", where, TRUNCATED)
        _, version, kind, nx, ny, nz, channels, *corners = HEADER.unpack(header)
        _check_header(where, version, kind, (nx, ny, nz), channels, channels_taken)
        count = nx * ny * nz * channels
        if HEADER.size + 4 * count > size:
            raise VolumeError(
                f"{nx} x {ny} x {nz} samples of {channels} channels need {HEADER.size + 4 * count} bytes, "
                f"the file has {size}",
                where,
                TRUNCATED,
            )
        box = np.array(corners, np.float64).reshape(2, 3)
        if not (np.isfinite(box).all() and (box[0] < box[1]).all()):
            raise VolumeError(f"its box {box.tolist()} is empty or not finite", where)
        values = allocate((nz, ny, nx, channels), "<f4", where)
        fill(values, file, where)
    values.flags.writeable = False
    return DenseGrid(values=values, box=box, name=Path(path).stem, source=where)


def _check_header(
    where: str, version: int, kind: int, size: tuple[int, int, int], channels: int, taken: tuple[int, ...]
) -> None:
    if version != VERSION:
        raise VolumeError(f"version {version} of the format is not supported, {VERSION} is", where)
    if kind != FLOAT32:
        raise VolumeError(f"samples of type {kind} are not supported, float32 (type {FLOAT32}) is", where)
    if channels not in taken:
        raise VolumeError(f"{channels} channels are not supported, 1 and 3 are", where)
    if min(size) < 1:
        raise VolumeError(f"its size {' x '.join(map(str, size))} is empty", where, TRUNCATED)


def write_vol(path: str | os.PathLike[str], values: np.ndarray, box: np.ndarray) -> None:
    """Write a .vol file that Mitsuba reads.

    Parameters
    ----------
    values : real array (nz, ny, nx) or (nz, ny, nx, channels) with 1 or 3 channels; stored as float32.
    box : (2, 3), lower and upper corner in x, y, z order, used by Mitsuba with use_grid_bbox = true.

    Raises VolumeError for other shapes, masked samples and an empty box, OptionError where the file cannot
    be written.
    """
    where = str(path)
    if masked_count(values):
        raise VolumeError(
            f"{masked_count(values)} samples are masked", where, "give them values: array.filled(0)"
        )
    values = np.asarray(values)
    if values.ndim == 3:
        values = values[..., None]
    box = np.asarray(box, np.float64)
    if values.ndim != 4 or values.shape[3] not in (1, 3) or values.size == 0:
        raise VolumeError(f"an array of shape {values.shape} is no [z, y, x] or [z, y, x, 1 | 3]", where)
    if box.shape != (2, 3) or not np.isfinite(box).all() or not (box[0] < box[1]).all():
        raise VolumeError(f"box {box.tolist()} is no lower and upper corner", where)
    nz, ny, nx, channels = values.shape
    with replacing(path) as file:
        file.write(HEADER.pack(b"VOL", VERSION, FLOAT32, nx, ny, nz, channels, *box.ravel()))
        for z in range(nz):
            file.write(np.ascontiguousarray(values[z], "<f4").data)
