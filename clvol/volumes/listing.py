"""Which grids a volume file holds, without reading their samples where the format allows that."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import VolumeError
from clvol.volumes import containers
from clvol.volumes.files import TRUNCATED, open_binary
from clvol.volumes.numpy_files import ZIP_ERRORS
from clvol.volumes.read import SPARSE, list_sparse

if TYPE_CHECKING:
    import os
    from collections.abc import Callable


@dataclass(frozen=True)
class Listed:
    """What a file says of one of its grids.

    name : what `read_volume` takes for it; "" for the only one of a format without names.
    unreadable : why it cannot be read, "" where it can.
    channels : values of a sample, 1 or 3; 0 where only reading tells, or it cannot be read.
    kind : what its values are, "fog volume", "level set" or "staggered", "" where the file does not say.
    """

    name: str
    unreadable: str = ""
    channels: int = 0
    kind: str = ""


def _sparse(path: str | os.PathLike[str]) -> list[Listed]:
    return [Listed(grid.name, grid.unreadable, grid.channels, grid.kind) for grid in list_sparse(path)]


def _npz(path: str | os.PathLike[str]) -> list[Listed]:
    with open_binary(path) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                return [Listed(name.removesuffix(".npy")) for name in archive.namelist()]
        except ZIP_ERRORS as error:
            raise VolumeError(f"the archive is damaged ({error})", str(path), TRUNCATED) from None


def _hdf5(path: str | os.PathLike[str]) -> list[Listed]:
    return [Listed(name) for name in containers.list_hdf5(path)]


def _zarr(path: str | os.PathLike[str]) -> list[Listed]:
    return [Listed(name) for name in containers.list_zarr(path)]


LISTERS: dict[str, Callable[[str | os.PathLike[str]], list[Listed]]] = {
    **dict.fromkeys(SPARSE, _sparse),
    ".npz": _npz,
    **dict.fromkeys(containers.HDF5_SUFFIXES, _hdf5),
    containers.ZARR_SUFFIX: _zarr,
}
"""By suffix, for formats with several grids in a file; files of others hold one without a name."""


def list_grids(path: str | os.PathLike[str]) -> list[Listed]:
    """The grids of a volume file in its order; VolumeError where it is missing or damaged.

    A file of a format that `LISTERS` lacks is not opened: it holds one grid without a name.
    """
    lister = LISTERS.get(Path(path).suffix.lower())
    return lister(path) if lister else [Listed("")]


def box_of(box: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Axis-aligned box (2, 3) round a box (2, 3) under an affine 4x4 `matrix`; float64."""
    lower, upper = np.asarray(box, np.float64)
    corners = np.array([np.where([i & 1, i & 2, i & 4], upper, lower) for i in range(8)])
    moved = corners @ matrix[:3, :3].T + matrix[:3, 3]
    return np.stack([moved.min(axis=0), moved.max(axis=0)])
