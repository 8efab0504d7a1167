"""How far apart the extinctions of a medium's channels are, and how deep it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.accel.bounds import classified
from clvol.scene import records
from clvol.scene.flakes import largest_area
from clvol.volumes.bricks import BrickMap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene.medium_facts import Matter
    from clvol.tables.volumes import PreparedVolume


def peak_extinction(medium: records.Medium, density: PreparedVolume | None) -> np.ndarray:
    """Largest sigma_t of each channel in any direction, per world length, float64 (3,).

    `density`: the volume that is the medium's sigma_t; None where it is homogeneous.
    """
    if isinstance(medium.sigma_t, records.ConstVolume):
        densest = np.asarray(medium.sigma_t.value, np.float64)
    else:
        assert density is not None
        densest = density.peak(medium.transfer("sigma_t"))
    densest = np.broadcast_to(densest, 3) * np.broadcast_to(np.asarray(medium.scale, np.float64), 3)
    return densest * largest_area(medium.phase)


def depth_across(matter: Matter, volumes: Sequence[PreparedVolume]) -> float:
    """Optical depth across a scene's one medium, on the mean over its box and edges, of the densest channel.

    From the extrema of cubes of 4³ cells, whose mean is nearer to the least: a guess, to decide what pays.
    Infinite where there is no such medium, or its volume is a tree.
    """
    volume = None
    if len(matter.media) == 1 and "sigma_t" in matter.roles[0]:
        volume = volumes[matter.roles[0]["sigma_t"]]
    if volume is None or not isinstance(volume.bricks, BrickMap):
        return np.inf
    bricks = volume.bricks
    transfer = matter.media[0].transfer("sigma_t")
    low, high = bricks.minimum, bricks.maximum
    if transfer is not None:
        low, high = classified(low, high, transfer)
    low, high = (side.mean(axis=(0, 1, 2), dtype=np.float64) for side in (low, high))
    mean = 0.75 * low + 0.25 * high
    edges = volume.voxel * bricks.size
    scale = np.array(matter.media[0].scale) * largest_area(matter.media[0].phase)
    return float(np.max(mean * scale) * edges.mean())


def channels_apart(matter: Matter, volumes: Sequence[PreparedVolume]) -> float:
    """How far channels are apart in the medium where they are most, at least 1; empty ones do not count."""
    ratio = 1.0
    for medium, roles in zip(matter.media, matter.roles, strict=True):
        extinction = peak_extinction(medium, volumes[roles["sigma_t"]] if "sigma_t" in roles else None)
        some = extinction[extinction > 0]
        if len(some):
            ratio = max(ratio, float(some.max() / some.min()))
    return ratio
