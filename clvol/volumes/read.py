"""Any supported volume, by its suffix or by what the folder holds: the one way to a grid from a file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from clvol.base.files import other_kind
from clvol.base.kinds import kind_of_file
from clvol.errors import VolumeError
from clvol.volumes import containers, itk, tiff, vti
from clvol.volumes.files import open_binary
from clvol.volumes.numpy_files import read_numpy
from clvol.volumes.nvdb import list_nvdb, read_nvdb
from clvol.volumes.nvdb_header import MAGICS
from clvol.volumes.vdb import list_vdb, read_vdb
from clvol.volumes.vol import read_vol

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from clvol.volumes.grid import Grid, SparseGrid
    from clvol.volumes.grid_info import GridInfo


def _is_nanovdb(path: str | os.PathLike[str]) -> bool:
    """Whether a sparse file is NanoVDB: OpenVDB's and NanoVDB's are told apart by what they begin with."""
    with open_binary(path) as file:
        start = file.read(8)
    return start in MAGICS or (Path(path).suffix.lower() == ".nvdb" and not start.startswith(b" BDV"))


def list_sparse(path: str | os.PathLike[str]) -> list[GridInfo]:
    """Grids of a .vdb or .nvdb file, as `list_vdb` and `list_nvdb` do."""
    return list_nvdb(path) if _is_nanovdb(path) else list_vdb(path)


def read_sparse(path: str | os.PathLike[str], grid: str | int | None = None) -> SparseGrid:
    """One grid of a .vdb or .nvdb file, by name or number, as their readers do."""
    return read_nvdb(path, grid) if _is_nanovdb(path) else read_vdb(path, grid)


def _vol(path: str | os.PathLike[str], grid: str | None) -> Grid:
    if grid is not None:
        raise VolumeError(f"a .vol file has no grid named {grid!r}", str(path), "leave the name out")
    return read_vol(path)


READERS: dict[str, Callable[[str | os.PathLike[str], str | None], Grid]] = {
    ".vdb": read_sparse,
    ".nvdb": read_sparse,
    ".vol": _vol,
    ".npy": read_numpy,
    ".npz": read_numpy,
    **dict.fromkeys(itk.SUFFIXES, itk.read_itk),
    **dict.fromkeys(tiff.SUFFIXES, tiff.read_tiff),
    **dict.fromkeys(containers.HDF5_SUFFIXES, containers.read_hdf5),
    vti.SUFFIX: vti.read_vti,
}
"""Suffix -> reader of a file and of the grid that is named, if any."""
SUFFIXES = (*READERS, containers.ZARR_SUFFIX)
SPARSE = (".vdb", ".nvdb")
"""Suffixes of files of sparse grids, with transforms of their own."""

_INSIDE = re.compile(
    rf"(?P<file>.*({'|'.join(map(re.escape, (*containers.HDF5_SUFFIXES, containers.ZARR_SUFFIX)))}))"
    r":(?P<grid>.*)",
    re.IGNORECASE | re.DOTALL,
)


def volume_suffix(path: str | os.PathLike[str]) -> str:
    """The suffix that says a file's format, in lower case: the last, or ".nii.gz"."""
    name = Path(path).name.lower()
    return next((s for s in SUFFIXES if s.count(".") > 1 and name.endswith(s)), Path(name).suffix)


def split_address(address: str) -> tuple[str, str | None]:
    """File or folder, and grid, of "scan.h5:/entry/density"; any other address has no grid."""
    found = _INSIDE.fullmatch(address)
    return (found["file"], found["grid"]) if found else (address, None)


def is_volume(path: str | os.PathLike[str]) -> bool:
    """Whether a name is a volume's rather than a scene's: by its suffix, or a folder."""
    name, inside = split_address(str(path))
    return inside is not None or volume_suffix(name) in SUFFIXES or Path(name).is_dir()


def read_volume(path: str | os.PathLike[str], grid: str | None = None) -> Grid:
    """Read a volume; the suffix of a file, in either case, says the format.

    Parameters
    ----------
    path : .vdb, .nvdb, .vol, .npy, .npz; with the extra `science` .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd,
        .dcm, .tif, .h5, .nc, .zarr, .vti, and a folder of DICOM slices.  "scan.h5:/density" names an array
        inside.
    grid : the grid of a .vdb or .nvdb (default "density", or the only one), the array of a .npz, .h5, .zarr
        or .vti (default the only one), the series of a DICOM folder; or of an array of more axes "[3]", its
        part.

    Raises VolumeError as the reader of the format does, and for other suffixes; OptionError where the package
    that reads the format is missing.
    """
    name, inside = split_address(str(path))
    if inside is not None:
        if grid is not None:
            raise VolumeError(f"names an array itself, and grid {grid!r} is given", str(path), "give one")
        path, grid = name, inside
    folder, suffix = Path(path), volume_suffix(path)
    if suffix == containers.ZARR_SUFFIX or (folder.is_dir() and containers.is_zarr(folder)):
        if not folder.is_dir():
            raise VolumeError("no such folder", str(path))
        return containers.read_zarr(path, grid)
    if folder.is_dir():
        return itk.read_dicom(path, grid)
    if suffix not in READERS:
        listed = f"{', '.join(SUFFIXES[:-1])} and {SUFFIXES[-1]}"
        if kind := other_kind(path):
            raise VolumeError(
                f"is {kind}, not a volume file", str(path), f"give a file: {listed} can be read"
            )
        what, hint = kind_of_file(path)
        if what:
            raise VolumeError(f"is {what}, not a volume", str(path), hint or f"volumes are {listed}")
        what = f"files ending in {suffix!r}" if suffix else "files without a suffix"
        raise VolumeError(f"{what} cannot be read, {listed} can", str(path))
    return READERS[suffix](path, grid)
