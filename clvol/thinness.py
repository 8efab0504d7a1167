"""Media that are thin beside the scene: what single precision leaves of them.  Pure NumPy."""

from __future__ import annotations

import logging

import numpy as np

from clvol.boundaries import Boundaries, MediumEntry, is_clipped, scene_sphere
from clvol.scene import records

log = logging.getLogger("clvol")

THIN = 2.0**-12
"""Share of the way from the camera below which a medium is thin: entry and exit, each rounded, would be off
by half a thousandth of the way between them."""

PLACED = 2.0**-16
"""Share of its coordinates below which places across a medium are rounded by more than a hundredth of it."""


def widths(to_world: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """Distances between opposite faces of a box of that extent under an affine map, float64 (3,)."""
    return extent / np.linalg.norm(np.linalg.inv(to_world)[:3, :3], axis=1)


def bounding_boxes(entry: MediumEntry) -> list[tuple[np.ndarray, np.ndarray]]:
    """Maps to world space and extents of the boxes that bound a medium's interval of a ray."""
    boxes, sigma_t = [], entry.medium.sigma_t
    if entry.shape is not None:
        boxes.append((entry.shape.to_world, np.full(3, 2.0)))
    if is_clipped(entry.medium):
        if isinstance(sigma_t, records.GridVolume):
            boxes.append((sigma_t.index_to_world, sigma_t.upper - sigma_t.lower))
        else:
            boxes.append((sigma_t.to_world, np.ones(3)))
    return boxes


def thin_media(scene: records.Scene, found: Boundaries) -> list[bool]:
    """Whether each medium is so thin that rays are measured from a point close to it: a shape or box that
    bounds it in closed form is thinner than THIN of what rays travel.  What surfaces bound is measured where
    rays meet them."""
    centre, radius = scene_sphere(scene, found)
    reach = radius + float(np.linalg.norm(scene.sensor.to_world[:3, 3] - centre))
    return [
        min((widths(*box).min() for box in bounding_boxes(entry)), default=np.inf) < THIN * reach
        for entry in found.entries
    ]
