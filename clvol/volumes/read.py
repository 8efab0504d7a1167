"""Any supported volume file, by its suffix."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clvol.base.files import other_kind
from clvol.errors import VolumeError
from clvol.volumes.files import NANOVDB
from clvol.volumes.numpy_files import read_numpy
from clvol.volumes.vdb import read_vdb
from clvol.volumes.vol import read_vol

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from clvol.volumes.grid import Grid


def _vdb(path: str | os.PathLike[str], grid: str | None) -> Grid:
    return read_vdb(path) if grid is None else read_vdb(path, grid)


def _vol(path: str | os.PathLike[str], grid: str | None) -> Grid:
    if grid is not None:
        raise VolumeError(f"a .vol file has no grid named {grid!r}", str(path), "leave the name out")
    return read_vol(path)


READERS: dict[str, Callable[[str | os.PathLike[str], str | None], Grid]] = {
    ".vdb": _vdb,
    ".vol": _vol,
    ".npy": read_numpy,
    ".npz": read_numpy,
}
"""Suffix -> reader of a file and of the grid that is named, if any."""
SUFFIXES = tuple(READERS)
CONVERSIONS = {".nvdb": NANOVDB}
"""Suffixes of volumes that cannot be read, and what makes one of them that can."""


def is_volume(path: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a volume, readable or not, rather than of a scene."""
    suffix = Path(path).suffix.lower()
    return suffix in READERS or suffix in CONVERSIONS


def read_volume(path: str | os.PathLike[str], grid: str | None = None) -> Grid:
    """Read a volume file; its suffix, in either case, says the format.

    Parameters
    ----------
    path : .vdb, .vol, .npy or .npz.
    grid : the grid of a .vdb (default "density") or the array of a .npz (default the only one).

    Raises VolumeError as the reader of the format does, and for other suffixes.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in READERS:
        listed = f"{', '.join(SUFFIXES[:-1])} and {SUFFIXES[-1]}"
        if kind := other_kind(path):
            raise VolumeError(
                f"is {kind}, not a volume file", str(path), f"give a file: {listed} can be read"
            )
        what = f"files ending in {suffix!r}" if suffix else "files without a suffix"
        raise VolumeError(f"{what} cannot be read, {listed} can", str(path), CONVERSIONS.get(suffix, ""))
    return READERS[suffix](path, grid)
