"""Dense grids of files that say where their samples lie, and parts of arrays of more axes."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.errors import GRID, VolumeError
from clvol.volumes.files import MAX_BYTES, allocate, place
from clvol.volumes.grid import DenseGrid
from clvol.volumes.narrowing import Narrowing
from clvol.volumes.numpy_files import check_layout

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

EVEN = 1e-3
"""Share of their mean by which steps between coordinates may differ and count as even: files round them."""
SLAB = 16 << 20
"""Bytes that are asked of a library at once."""
_ADDRESS = re.compile(r"(?P<name>.*?)\s*\[\s*(?P<indices>\d+(\s*,\s*\d+)*)\s*\]", re.DOTALL)


class Axis(NamedTuple):
    """Where the samples of one axis lie: the first one's coordinate, and the step to the next."""

    origin: float = 0.0
    spacing: float = 1.0


def placed_grid(
    values: np.ndarray,
    axes: Sequence[Axis],
    *,
    direction: np.ndarray | None = None,
    unit: str = "",
    name: str = "",
    source: str = "",
) -> DenseGrid:
    """A dense grid where its file says.

    Parameters
    ----------
    values : float32 (nz, ny, nx, channels) that nobody else holds.
    axes : of x, y and z; the origins are the position of the first sample's middle.  Those that fall, as
        latitudes may, are turned round with their samples.
    direction : float64 (3, 3), its columns the directions of the axes in the world; the identity by default.
    unit : of the positions, as "mm".

    Raises VolumeError where they place nothing: numbers that are not finite, or axes in one plane.
    """
    if direction is None:
        values, axes = _rising(values, axes)
    to_world = np.eye(4)
    spacing = np.array([axis.spacing for axis in axes], np.float64)
    to_world[:3, :3] = (np.eye(3) if direction is None else direction) * spacing
    to_world[:3, 3] = [axis.origin for axis in axes]
    lengths = np.linalg.norm(to_world[:3, :3], axis=0)
    volume = abs(np.linalg.det(to_world[:3, :3] / np.where(lengths > 0, lengths, 1)))
    if not np.isfinite(to_world).all() or not (lengths > 0).all() or volume < 1e-6:
        origin = to_world[:3, 3].tolist()
        raise VolumeError(
            f"its spacing {spacing.tolist()}, origin {origin} and directions place no volume",
            place(source, name),
            "mend the file's header",
        )
    values.flags.writeable = False
    corners = (
        to_world
        @ np.array(
            [(*(np.array(ends) * np.array(values.shape[2::-1]) - 0.5), 1) for ends in np.ndindex(2, 2, 2)]
        ).T
    )  # the corners of the outermost voxels
    box = np.array([corners[:3].min(axis=1), corners[:3].max(axis=1)])
    return DenseGrid(values, box, name, source, to_world, unit)


def _rising(values: np.ndarray, axes: Sequence[Axis]) -> tuple[np.ndarray, list[Axis]]:
    """Samples and axes with those axes turned round whose coordinates fall."""
    rising = []
    for number, (axis, count) in enumerate(zip(axes, values.shape[2::-1], strict=True)):
        if axis.spacing < 0:
            values = np.ascontiguousarray(np.flip(values, 2 - number))
            axis = Axis(axis.origin + axis.spacing * (count - 1), -axis.spacing)
        rising.append(axis)
    return values, rising


def axis_of(coordinates: np.ndarray, what: str, where: str) -> Axis:
    """The origin and spacing of an axis that has a coordinate for each sample.

    Raises VolumeError where they are no numbers or unevenly spaced.
    """
    numbers = np.asarray(coordinates)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iuf" or not np.isfinite(numbers).all():
        raise VolumeError(f"the coordinates of its axis {what} are no plain numbers", where)
    numbers = numbers.astype(np.float64)
    if len(numbers) < 2:
        return Axis(float(numbers[0]) if len(numbers) else 0.0)
    steps = np.diff(numbers)
    mean = float((numbers[-1] - numbers[0]) / (len(numbers) - 1))
    if mean == 0 or np.abs(steps - mean).max() > EVEN * abs(mean):
        raise VolumeError(
            f"the coordinates of its axis {what} are unevenly spaced: steps from {steps.min():g} "
            f"to {steps.max():g}",
            where,
            "interpolate it to even steps first (of xarray: array.interp)",
        )
    return Axis(float(numbers[0]), mean)


def split_indices(name: str | None) -> tuple[str | None, tuple[int, ...]]:
    """Name of an array, and which part of it: "density[3]" is ("density", (3,)), "[3]" is (None, (3,))."""
    found = _ADDRESS.fullmatch(name) if name is not None else None
    if not found:
        return name, ()
    return found["name"] or None, tuple(int(number) for number in found["indices"].split(","))


def part_of(
    shape: Sequence[int], indices: tuple[int, ...], channels: bool, where: str, axes: str = ""
) -> tuple[int, ...]:
    """Indices of an array's leading axes, that leave [z, y, x], or with `channels` [z, y, x, channel].

    Leading axes of one sample need none; `axes` are their names in messages.  Raises VolumeError where others
    are not said, or are beyond the array.
    """
    leading = tuple(shape[: max(len(shape) - 3 - channels, 0)])
    long = [n for n, size in enumerate(leading) if size > 1]
    if len(indices) == len(leading):
        long = list(range(len(leading)))
    if len(indices) != len(long):
        said = " x ".join(map(str, shape)) + (f" ({axes})" if axes else "")
        which = ",".join("0" for _ in long)
        hint = (
            f"name one volume of it by {GRID}, such as [{which}]" if long else "leave the numbers in [] out"
        )
        raise VolumeError(
            f"is an array of {said} samples, which takes {len(long)} numbers in []", where, hint
        )
    chosen = [0] * len(leading)
    for axis, index in zip(long, indices, strict=True):
        if index >= leading[axis]:
            raise VolumeError(f"has no part [{index}] of {leading[axis]} along axis {axis}", where)
        chosen[axis] = index
    return tuple(chosen)


def check_size(shape: Sequence[int], where: str) -> None:
    """VolumeError where as many float32 samples are more than the memory that files may take."""
    needed = 4 * math.prod(shape)
    if needed > MAX_BYTES:
        raise VolumeError(
            f"{needed} bytes of memory are needed, the limit is {MAX_BYTES}",
            where,
            "store a part of it, or a coarser one",
        )


def samples(
    shape: Sequence[int], dtype: np.dtype, read: Callable[[slice], np.ndarray], where: str
) -> np.ndarray:
    """An array [z, y, x] or [z, y, x, channel] as float32 (nz, ny, nx, channels), some planes at a time.

    read : returns the planes of a slice of z.

    Raises VolumeError for other shapes and types, and more than the memory that files may take.
    """
    check_layout(dtype, tuple(shape), where)
    check_size(shape, where)
    values, narrowed = allocate(tuple(shape), np.float32, where), Narrowing(where)
    planes = max(SLAB // (dtype.itemsize * max(math.prod(shape[1:]), 1)), 1)
    for first in range(0, shape[0], planes):
        part = np.asarray(read(slice(first, min(first + planes, shape[0]))))
        values[first : first + planes] = narrowed(part)
    narrowed.check()
    return values[..., None] if values.ndim == 3 else values
