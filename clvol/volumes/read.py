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

    from clvol.volumes.grid import Grid

SUFFIXES = (".vdb", ".vol", ".npy", ".npz")
CONVERSIONS = {".nvdb": NANOVDB}
"""Suffixes of volumes that cannot be read, and what makes one of them that can."""


def read_volume(path: str | os.PathLike[str], grid: str | None = None) -> Grid:
    """Read a volume file; its suffix, in either case, says the format.

    Parameters
    ----------
    path : .vdb, .vol, .npy or .npz.
    grid : the grid of a .vdb (default "density") or the array of a .npz (default the only one).

    Raises VolumeError as the reader of the format does, and for other suffixes.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".vdb":
        return read_vdb(path) if grid is None else read_vdb(path, grid)
    if suffix in (".npy", ".npz"):
        return read_numpy(path, grid)
    if suffix != ".vol":
        listed = f"{', '.join(SUFFIXES[:-1])} and {SUFFIXES[-1]}"
        if kind := other_kind(path):
            raise VolumeError(
                f"is {kind}, not a volume file", str(path), f"give a file: {listed} can be read"
            )
        what = f"files ending in {suffix!r}" if suffix else "files without a suffix"
        raise VolumeError(f"{what} cannot be read, {listed} can", str(path), CONVERSIONS.get(suffix, ""))
    if grid is not None:
        raise VolumeError(f"a .vol file has no grid named {grid!r}", str(path), "leave the name out")
    return read_vol(path)
