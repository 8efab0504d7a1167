"""A volume for Python users: read, and what its samples are taken for."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from clvol.base.arguments import flag
from clvol.errors import OptionError, shown
from clvol.volumes.level_set import USES, fog_of
from clvol.volumes.read import read_volume
from clvol.volumes.repair import sanitized, warn_of

if TYPE_CHECKING:
    from clvol.volumes.grid import DenseGrid, SparseGrid


def load_volume(
    path: str | os.PathLike[str],
    grid: str | None = None,
    *,
    level_set: str | None = None,
    sanitize: bool = False,
) -> SparseGrid | DenseGrid:
    """A grid of a volume file, as a gridvolume of a scene takes it (`"data": grid`).

    Parameters
    ----------
    path : .vdb, .nvdb, .vol, .npy, .npz or what else `clvol.volumes.read_volume` reads.
    grid : which of the file's grids or arrays; default "density" of sparse files, or the
        only one.
    level_set : "fog" makes a fog volume of a level set (OpenVDB's sdfToFogVolume).
    sanitize : NaN and slightly negative samples, down to a tenth of the greatest, become 0; a warning counts
        them.

    Returns
    -------
    SparseGrid or DenseGrid
        Samples, float32 [..., channel], and where they lie.

    Raises
    ------
    VolumeError
        The file is missing, damaged, or of no use.
    OptionError
        What is no file's name, another `level_set`, or the package that reads the format is missing.
    """
    try:
        path = os.fsdecode(path)
    except TypeError:
        raise OptionError(f"load_volume takes a file's name, not {shown(path)}") from None
    sanitize = flag("sanitize", sanitize)
    if level_set not in (None, *USES):
        raise OptionError(f"level_set cannot be {shown(level_set)}", hint=f"supported: {', '.join(USES)}")
    read = read_volume(path, grid)
    if level_set is not None:
        read = fog_of(read)
    if not sanitize:
        return read
    mended, repairs = sanitized(read)
    warn_of(read, repairs)
    return mended
