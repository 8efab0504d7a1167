"""The perspective camera as the device needs it: rays that are affine in the pixel position.

Everything is worked out in double.  Rays do not start at the pinhole but on the plane that lies just
before the scene's bounding sphere (or the near plane): a float position there keeps its precision
however far away the camera stands.  Rays of a thin lens start on that plane as well: there they are as far
from the pinhole's as their point of the lens from its centre, shrunk in proportion to the depth still to go
to the plane in focus, where all of a film position's rays meet (Kolb, Mitchell, Hanrahan 1995).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene.sensor import field_of_view_x

if TYPE_CHECKING:
    from clvol.scene.records import Film, Perspective


@dataclass(frozen=True, eq=False)
class CameraRays:
    """Ray of position (x, y), in pixels from the corner of the film's window.

    origin = position + x dx + y dy (relative to the scene's centre), direction ∝ base + x base_dx + y
    base_dy. `far`: depth of the far plane beyond the origins.

    A point (u, v) of the unit disk is l = u lens_x + v lens_y of a thin lens; it moves the origin by
    lens_start l and the direction, before it is normalised, by -lens_bend l.
    """

    eye: np.ndarray
    position: np.ndarray
    dx: np.ndarray
    dy: np.ndarray
    base: np.ndarray
    base_dx: np.ndarray
    base_dy: np.ndarray
    forward: np.ndarray
    far: float
    lens_x: np.ndarray
    lens_y: np.ndarray
    lens_start: float
    lens_bend: float


def camera_rays(sensor: Perspective, film: Film, centre: np.ndarray, radius: float) -> CameraRays:
    """Rays of `sensor`, relative to `centre`; `radius` bounds everything they can hit (world units).

    The field of view is that of the whole film; a crop cuts its window out of it.
    """
    tangent = math.tan(field_of_view_x(sensor, film) / 2)
    linear, eye = sensor.to_world[:3, :3], sensor.to_world[:3, 3] - centre
    offset_x, offset_y = sensor.principal_point_offset
    # local +x is the image's left, local +y its top
    per_pixel = 2 * tangent / film.width
    half_height = tangent * film.height / film.width
    corner = np.array([tangent * (1 - 2 * offset_x), half_height * (1 - 2 * offset_y), 1.0])
    base, dx, dy = linear @ corner, linear @ [-per_pixel, 0, 0], linear @ [0, -per_pixel, 0]
    if film.crop:
        base = base + film.crop[0] * dx + film.crop[1] * dy
    forward = linear[:, 2] / np.linalg.norm(linear[:, 2])
    unit = float(base @ forward)  # depth of a ray at parameter 1; the same for every pixel
    depth = max(sensor.near_clip * unit, float(-eye @ forward) - radius)
    start = depth / unit
    lens_x, lens_y = sensor.aperture_radius * linear[:, 0], sensor.aperture_radius * linear[:, 1]
    return CameraRays(
        *(
            eye,
            eye + start * base,
            start * dx,
            start * dy,
            base,
            dx,
            dy,
            forward,
            sensor.far_clip * unit - depth,
        ),
        *(lens_x, lens_y, 1 - start / sensor.focus_distance, 1 / sensor.focus_distance),
    )
