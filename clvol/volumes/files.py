"""Opening the files of volumes: what the operating system refuses becomes a VolumeError."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from clvol.errors import VolumeError

TRUNCATED = "the file is truncated or damaged: copy or export it again"

# Bytes a reader may hold in arrays of its own; memory maps do not count.
MAX_BYTES = 4 << 30


@contextmanager
def open_binary(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open `path` for reading bytes; VolumeError if it is missing, empty, not a file or not readable."""
    path = Path(path)
    if path.is_dir():
        raise VolumeError("is a folder, not a volume file", str(path))
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise VolumeError("no such file", str(path)) from None
    except (OSError, ValueError) as error:
        raise VolumeError(f"cannot be opened ({error})", str(path)) from None
    with file:
        if os.fstat(file.fileno()).st_size == 0:
            raise VolumeError("the file is empty", str(path), TRUNCATED)
        yield file


def allocate(shape: int | tuple[int, ...], dtype: npt.DTypeLike, where: str) -> np.ndarray:
    """An uninitialised array; VolumeError if the machine lacks the memory."""
    try:
        return np.empty(shape, dtype)
    except MemoryError as error:
        raise VolumeError(f"there is not enough memory ({error})", where, "use a smaller grid") from None


def place(source: str, grid: str) -> str:
    """File and grid as error messages name them; either may be empty."""
    named = f"grid {grid!r}" if grid else ""
    return ", ".join(part for part in (source, named) if part)
