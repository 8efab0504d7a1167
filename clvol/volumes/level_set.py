"""Level sets to fog volumes: signed distances to a surface to densities from 0 at it to 1 inside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clvol.errors import VolumeError, parameter
from clvol.volumes.files import place
from clvol.volumes.grid import FOG_VOLUME, LEVEL_SET, DenseGrid, Grid, SparseGrid
from clvol.volumes.sparse_parts import active_box

TO_FOG = "fog"
USES = (TO_FOG,)
"""What may be asked for of a level set."""


def fog_of(grid: Grid) -> SparseGrid:
    """A level set as a fog volume, as OpenVDB's tools::sdfToFogVolume makes it.

    Distances d below 0, which are inside, become d / d₀, where d₀ is that of the inner tiles, or the least
    where there are none: 1 from the inner border of the narrow band on.  The rest becomes inactive 0.

    Raises VolumeError for dense grids, vectors, and a grid whose file says that it is something else.
    """
    where = place(grid.source, grid.name)
    if isinstance(grid, DenseGrid):
        raise VolumeError(
            "is no level set of a .vdb or .nvdb file", where, f"leave {parameter('level_set')} out"
        )
    if grid.kind not in ("", LEVEL_SET) or grid.channels != 1:
        what = f"a {grid.kind}" if grid.kind else "a field of vectors"
        raise VolumeError(f"is {what}, not a level set", where, f"leave {parameter('level_set')} out")
    inside = grid.tile_values[:, 0] < 0
    least = np.fmin.reduce(grid.tile_values[inside], axis=None, initial=np.float32(0))
    if not least:
        least = np.fmin.reduce(grid.leaf_values, axis=None, initial=np.float32(0))
    values = np.minimum(grid.leaf_values, 0)
    if least:
        with np.errstate(over="ignore", invalid="ignore"):  # the checks count what is not finite
            values *= np.float32(1) / least
        values += np.float32(0)  # no -0
    # what is not finite is active, for the checks to count
    active = np.packbits(
        (values[..., 0] != 0).transpose(0, 3, 2, 1).reshape(-1, 512), axis=1, bitorder="little"
    )
    kept = (values != 0).any(axis=(1, 2, 3, 4))
    values, active, origins = values[kept], active[kept], grid.leaf_origins[kept]
    tiles, edges = grid.tile_origins[inside], grid.tile_sizes[inside]
    return replace(
        grid,
        leaf_origins=origins,
        leaf_values=values,
        leaf_active=active,
        tile_origins=tiles,
        tile_sizes=edges,
        tile_values=np.ones((len(tiles), 1), np.float32),
        tile_active=np.ones(len(tiles), bool),
        background=np.zeros(1, np.float32),
        active_box=active_box(origins, active, tiles, edges),
        kind=FOG_VOLUME,
    )
