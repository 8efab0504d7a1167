"""Where the camera stands: directions by angles, and the distance from which points fill the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clvol.scene.transforms import look_at

FOV = 35.0
"""Degrees along the longer side of the picture."""
RING = 180
"""Points of the ring that a point describes on a turntable."""
MARGIN = 0.08
"""Share of the picture that is left free on each side."""


@dataclass(frozen=True, eq=False)
class Axes:
    """Directions (3,) of a world whose `up` is y or z: `front` points to who looks at the front."""

    up: np.ndarray
    front: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, up: str) -> Axes:
        """As programs with y up have it (the front towards +z), or those with z up (towards -y)."""
        front = (0.0, 0.0, 1.0) if up == "y" else (0.0, -1.0, 0.0)
        above = (0.0, 1.0, 0.0) if up == "y" else (0.0, 0.0, 1.0)
        return cls(np.array(above), np.array(front), np.array([1.0, 0.0, 0.0]))

    def towards(self, azimuth: float, elevation: float) -> np.ndarray:
        """Unit direction at these degrees: 0 to the front, 90 to the right; above the horizon."""
        a, e = np.deg2rad([azimuth, elevation])
        level = np.cos(a) * self.front + np.sin(a) * self.right
        direction: np.ndarray = np.cos(e) * level + np.sin(e) * self.up
        return direction


@dataclass(frozen=True, eq=False)
class View:
    """A camera: to_world (4, 4) as `look_at` has it, its place and the degrees that it was chosen by."""

    to_world: np.ndarray
    azimuth: float
    elevation: float
    distance: float

    @property
    def eye(self) -> np.ndarray:
        """Where it is."""
        return self.to_world[:3, 3]


def half_tangents(width: int, height: int) -> tuple[float, float]:
    """Of half the field of view along x and y."""
    longer = np.tan(np.deg2rad(FOV) / 2)
    return longer * width / max(width, height), longer * height / max(width, height)


def frame(
    points: np.ndarray,
    axes: Axes,
    azimuth: float,
    elevation: float,
    size: tuple[int, int],
    closer: float = 1.0,
) -> View:
    """The camera that sees points (n, 3) of the world as large as they fit the picture, but for the margin.

    A point at (x, y, z) of the camera's axes through the middle of them all, z pointing away from the camera,
    is in the picture of a camera at (cx, cy, -d) if |x - cx| <= t (d + z), with t the tangent of half the
    field of view, and so for y.  The smallest d for which there is a cx follows from the outermost points.

    closer : multiplies the distance.
    """
    away = -axes.towards(azimuth, elevation)
    # Seen from above or below the front is at the bottom of the picture.
    steep = abs(float(away @ axes.up)) > 1 - 1e-9
    up = -np.sign(-away @ axes.up) * axes.towards(azimuth, 0.0) if steep else axes.up
    rotation = look_at(-away, np.zeros(3), up)[:3, :3]
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    local = (points - centre) @ rotation
    needed, offsets = [], []
    for coordinate, tangent in zip(local.T[:2], half_tangents(*size), strict=True):
        t = tangent * (1 - 2 * MARGIN)
        needed.append(((coordinate - t * local[:, 2]).max() - (coordinate + t * local[:, 2]).min()) / (2 * t))
        offsets.append(((coordinate - t * local[:, 2]).max() + (coordinate + t * local[:, 2]).min()) / 2)
    distance = closer * max(*needed, 1e-6)
    to_world = np.eye(4)
    to_world[:3, :3] = rotation
    to_world[:3, 3] = centre + rotation @ np.array([*offsets, -distance])
    return View(to_world, azimuth, elevation, distance)


def revolved(points: np.ndarray, axes: Axes, centre: np.ndarray) -> np.ndarray:
    """The rings (n, 3) that points describe as they turn about the vertical axis through the centre."""
    local = points - centre
    height = local @ axes.up
    radius = np.linalg.norm(local - height[:, None] * axes.up, axis=1)
    angles = np.linspace(0, 2 * np.pi, RING, endpoint=False)[:, None]
    rings = np.cos(angles)[..., None] * axes.front + np.sin(angles)[..., None] * axes.right
    turned: np.ndarray = centre + radius[:, None] * rings + height[:, None] * axes.up
    return turned.reshape(-1, 3)
