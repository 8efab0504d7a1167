"""What a picture's labels need to know of its scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.picture.scenery import Scenery
from clvol.scene.records import GridVolume, IrradianceMeter, Meter
from clvol.tables.camera import camera_rays
from clvol.volumes.grid import DenseGrid

if TYPE_CHECKING:
    from clvol.tables.prepare import PreparedScene


def scenery_of(prepared: PreparedScene) -> Scenery | None:
    """The camera and the one volume that has an extinction; None where there are none or several.

    There are no labels of what a meter measures.
    """
    if isinstance(prepared.scene.camera, Meter | IrradianceMeter):
        return None
    volumes = {id(m.sigma_t): m for m in prepared.matter.media if isinstance(m.sigma_t, GridVolume)}
    if len(volumes) != 1:
        return None
    [medium] = volumes.values()
    volume = medium.sigma_t
    assert isinstance(volume, GridVolume)
    rays = camera_rays(prepared.scene.camera, prepared.scene.film, np.zeros(3), np.inf)
    linear, offset = volume.index_to_world[:3, :3], volume.index_to_world[:3, 3]
    start, columns = rays.frame
    right = rays.dx if rays.parallel else rays.base_dx
    return Scenery(
        start,
        np.linalg.inv(columns),
        right / np.linalg.norm(right),
        linear @ volume.lower + offset,
        (linear * (volume.upper - volume.lower)).T,
        volume.grid.unit if isinstance(volume.grid, DenseGrid) else "",
        medium.transfers,
        rays.parallel,
    )
