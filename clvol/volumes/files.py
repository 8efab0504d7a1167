"""Reading the files of volumes: what the operating system refuses becomes a VolumeError."""

from __future__ import annotations

import math
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from clvol.base.files import open_regular
from clvol.base.memory import available_memory
from clvol.errors import VolumeError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from io import BufferedIOBase, BufferedReader

TRUNCATED = "the file is truncated or damaged: copy or export it again"

# Bytes that a reader may make of a file that is smaller: compressed, or of a shorter type.  A plain one
# takes its own size.
MAX_BYTES = 4 << 30
# Bytes asked of a file at once.
CHUNK = 4 << 20
# Bytes from which on the system is asked whether it has them.
ASKED = 64 << 20


@contextmanager
def open_binary(path: str | os.PathLike[str]) -> Iterator[BufferedReader]:
    """Open `path` for reading bytes; VolumeError as `open_regular`, and if it is empty."""
    with open_regular(path, VolumeError, "volume file") as file:
        if os.fstat(file.fileno()).st_size == 0:
            raise VolumeError("the file is empty", str(path), TRUNCATED)
        yield file


def fill(array: np.ndarray, file: BufferedIOBase, where: str) -> None:
    """Read the bytes of a C-contiguous array; VolumeError if the file has fewer left."""
    target = array.reshape(-1).data.cast("B")
    filled = 0
    while filled < len(target):
        got = file.readinto(target[filled : filled + CHUNK])
        if not got:
            raise VolumeError(f"its data ends after {filled} of {len(target)} bytes", where, TRUNCATED)
        filled += got


def allocate(shape: int | tuple[int, ...], dtype: npt.DTypeLike, where: str) -> np.ndarray:
    """An uninitialised array; VolumeError if the machine lacks the memory."""
    count = math.prod(shape) if isinstance(shape, tuple) else shape
    needed, free = count * np.dtype(dtype).itemsize, None
    if needed > ASKED:
        free = available_memory()
    if free is not None and needed > free:
        what = f"{needed} bytes of memory are needed, {free} are free"
        raise VolumeError(what, where, "use a smaller grid")
    try:
        return np.empty(shape, dtype)
    except MemoryError as error:
        raise VolumeError(f"there is not enough memory ({error})", where, "use a smaller grid") from None


def place(source: str, grid: str) -> str:
    """File and grid as error messages name them; either may be empty."""
    named = f"grid {grid!r}" if grid else ""
    return ", ".join(part for part in (source, named) if part)
