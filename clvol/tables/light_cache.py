"""The grid of the cache of lights (cl/emitter/light_cache.h): where it lies, and what is typical in it.

Pure NumPy.  Nothing here changes the mean of a picture.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.scene import records
from clvol.scene.boundaries import entry_bounds, is_clipped
from clvol.scene.medium_facts import is_homogeneous

if TYPE_CHECKING:
    from clvol.tables.prepare import PreparedScene

EDGE = 32
"""Cells along the longest side of the grid."""
SKY_DIRECTIONS = 6
"""Along the axes, both ways."""


def light_cache_record(prepared: PreparedScene) -> np.ndarray:
    """The LIGHT_CACHE record, without what is typical: cubic cells over all heterogeneous media."""
    lower, upper = heterogeneous_bounds(prepared)
    longest = float((upper - lower).max()) or 1.0  # media that their volumes miss
    record = np.zeros(1, layout.LIGHT_CACHE)
    record["lower"], record["cells_per_length"] = lower - prepared.centre, EDGE / longest
    record["size"] = np.clip(np.ceil((upper - lower) / longest * EDGE - 1e-3), 1, EDGE)
    record["upper"] = record["lower"] + record["size"] * np.float32(longest / EDGE)
    return record


def rows(prepared: PreparedScene) -> int:
    """Numbers that a cell has: one of each light that has any, and six of a sky."""
    features = prepared.plan.features
    lights = min(features.sampled_emitters, layout.MOST_WEIGHED_LIGHTS)
    return lights + SKY_DIRECTIONS * features.samples_sky


def heterogeneous_bounds(prepared: PreparedScene) -> tuple[np.ndarray, np.ndarray]:
    """World bounds of all heterogeneous media, float64 (3,) each.

    Media that fill all space count as far as the samples of their volume reach.
    """
    entries = prepared.boundaries.entries
    boxes = []
    for entry, (lower, upper) in zip(entries, entry_bounds(prepared.scene, prepared.boundaries), strict=True):
        sigma_t = entry.medium.sigma_t
        if is_homogeneous(entry.medium):
            continue
        if is_clipped(entry.medium) or entry.everywhere:
            low, high = volume_bounds(sigma_t)
            lower, upper = np.maximum(lower, low), np.minimum(upper, high)
        boxes.append((lower, np.maximum(lower, upper)))
    return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)


def volume_bounds(volume: records.Volume) -> tuple[np.ndarray, np.ndarray]:
    """World bounds of a volume's box, float64 (3,) each."""
    if isinstance(volume, records.GridVolume):
        to_world, sides = volume.index_to_world, np.array([volume.lower, volume.upper])
    else:
        to_world, sides = volume.to_world, np.array([np.zeros(3), np.ones(3)])
    corners = np.array(
        [(*(sides[k][axis] for axis, k in enumerate(ks)), 1.0) for ks in product((0, 1), repeat=3)]
    )
    world = (corners @ to_world.T)[:, :3]
    return world.min(axis=0), world.max(axis=0)


def typical_radiance(extinction: np.ndarray, received: np.ndarray) -> float:
    """Radiance of singly scattered light that half of that light does not exceed; 0 where there is none.

    Parameters
    ----------
    extinction : mean of each cell, (n,).
    received : light that a cell receives, integral over all directions, (n,).
    """
    radiance = received.astype(np.float64) / (4 * np.pi)
    scattered = extinction * radiance
    order = np.argsort(radiance, kind="stable")
    share = np.cumsum(scattered[order])
    if not share.size or not 0 < share[-1] < np.inf:
        return 0.0
    return float(radiance[order[np.searchsorted(share, share[-1] / 2)]])
