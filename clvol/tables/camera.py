"""Cameras as the device needs them: rays that are affine in the pixel position.

Everything is worked out in double.  Rays do not start at the pinhole but on the plane that lies just
before the scene's bounding sphere (or the near plane): a float position there keeps its precision
however far away the camera stands.  Rays of a thin lens start on that plane as well: there they are as far
from the pinhole's as their point of the lens from its centre, shrunk in proportion to the depth still to go
to the plane in focus, where all of a film position's rays meet (Kolb, Mitchell, Hanrahan 1995).

Parallel rays have one direction, and places that are affine in the pixel position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.layout import enum
from clvol.scene.records import IrradianceMeter, Meter, Orthographic, Shape, measured_shape
from clvol.scene.sensor import field_of_view_x
from clvol.tables.meters import meter_faces

if TYPE_CHECKING:
    from clvol.scene.records import Camera, Film, Perspective


@dataclass(frozen=True, eq=False)
class CameraRays:
    """Ray of position (x, y), in pixels from the corner of the film's window.

    origin = position + x dx + y dy (relative to the scene's centre), direction ∝ base + x base_dx + y
    base_dy. `far`: depth of the far plane beyond the origins.

    A point (u, v) of the unit disk is l = u lens_x + v lens_y of a thin lens; it moves the origin by
    lens_start l and the direction, before it is normalised, by -lens_bend l.

    Of `parallel` rays the base is unit and they have no lens.
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
    parallel: bool = False

    @property
    def frame(self) -> tuple[np.ndarray, np.ndarray]:
        """Where rays start, and the columns (3, 3) that take a pixel (x, y, 1) to what is seen there."""
        if self.parallel:
            return self.position, np.column_stack((self.dx, self.dy, self.base))
        return self.eye, np.column_stack((self.base_dx, self.base_dy, self.base))

    def place(self, points: np.ndarray) -> np.ndarray:
        """Where points (n, 3) are seen: x, y, and the parameter along the ray, > 0 in front; (3, n)."""
        start, columns = self.frame
        a, b, depth = np.linalg.solve(columns, (points - start).T)
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = (a, b) if self.parallel else (a / depth, b / depth)
        return np.stack([*seen, depth])

    def distance(self, point: np.ndarray) -> float:
        """Distance of a point from the camera: its pinhole, or the plane through its place."""
        way = point - self.eye
        return float(way @ self.forward) if self.parallel else float(np.linalg.norm(way))


def camera_rays(sensor: Camera, film: Film, centre: np.ndarray, radius: float) -> CameraRays:
    """Rays of `sensor`, relative to `centre`; `radius` bounds everything they can hit (world units).

    What is seen is that of the whole film; a crop cuts its window out of it.
    """
    if isinstance(sensor, Meter):
        return _meter_rays(sensor, centre, radius)
    if isinstance(sensor, IrradianceMeter):
        return _first_ray(sensor, centre)
    if isinstance(sensor, Orthographic):
        return _parallel_rays(sensor, film, centre, radius)
    return _perspective_rays(sensor, film, centre, radius)


def _meter_rays(sensor: Meter, centre: np.ndarray, radius: float) -> CameraRays:
    """All along one line, over a rectangle by the place in the pixel, or over a disk by that on the lens."""
    forward, nothing = sensor.to_world[:3, 2], np.zeros(3)
    eye = sensor.to_world[:3, 3] - centre
    dx = dy = lens_x = lens_y = nothing
    if not sensor.distant:
        position = eye + max(0.0, float(-eye @ forward) - radius) * forward
    elif (shape := measured_shape(sensor)) is not None:
        eye = position = meter_faces(shape, centre)[0]["place"] - 2 * radius * forward
        lens_x = -2 * radius * forward  # from there; places are drawn on the device
    elif isinstance(sensor.target, Shape):
        middle, (x, y) = sensor.target.to_world[:3, 3] - centre, sensor.target.to_world[:3, :2].T
        eye = position = middle - 2 * radius * forward
        if sensor.target.kind == "disk":
            lens_x, lens_y = x, y
        else:
            dx, dy = 2 * x, 2 * y
            position = position - x - y
    elif sensor.target is not None:
        eye = position = sensor.target - centre - 2 * radius * forward
    else:
        eye = position = -radius * forward
        lens_x, lens_y = radius * sensor.to_world[:3, :2].T
    return CameraRays(
        *(eye, position, dx, dy, forward, nothing, nothing, forward, np.inf),
        *(lens_x, lens_y, 1.0, 0.0),
        parallel=True,
    )


def _first_ray(sensor: IrradianceMeter, centre: np.ndarray) -> CameraRays:
    """The ray that leaves an irradiancemeter in the middle of its first face; the device draws its own."""
    face, nothing = meter_faces(sensor.shape, centre)[0], np.zeros(3)
    inside = {"triangle": (1 / 3, 1 / 3), "sphere": (1.0, 0.0), "disk": (0.0, 0.0), "cylinder": (1.0, 0.0)}
    x, y = list(inside.values())[face["kind"]]
    out = x * face["x"].astype(float) + y * face["y"]
    round_ = face["kind"] in (enum("METER", "sphere"), enum("METER", "cylinder"))
    normal = face["side"] * out / np.linalg.norm(out) if round_ else face["z"].astype(float)
    start = face["place"] + out + 1e-5 * float(np.linalg.norm(face["x"])) * normal
    return CameraRays(
        *(face["place"].astype(float), start, nothing, nothing, normal, nothing, nothing, normal, np.inf),
        *(nothing, nothing, 1.0, 0.0),
    )


def reach_of(sensor: Camera, radius: float, everywhere: bool) -> float:
    """How far rays may meet something, of a scene of such a radius, where a medium may be everywhere.

    Distant sensors look at the scene's sphere, whatever is beyond.
    """
    distant = isinstance(sensor, Meter) and sensor.distant
    return np.inf if everywhere and not distant else radius


def _parallel_rays(sensor: Orthographic, film: Film, centre: np.ndarray, radius: float) -> CameraRays:
    left, top, width, height = film.window
    x, y = left + np.array([0, width, 0, width]), top + np.array([0, 0, height, height])
    corners = sensor.at(x, y, film) - centre
    forward, nothing = sensor.forward, np.zeros(3)
    start = max(0.0, float(-(corners @ forward).max()) - radius)
    return CameraRays(
        eye=sensor.to_world[:3, 3] - centre,
        position=corners[0] + start * forward,
        dx=(corners[1] - corners[0]) / width,
        dy=(corners[2] - corners[0]) / height,
        base=forward,
        base_dx=nothing,
        base_dy=nothing,
        forward=forward,
        far=sensor.far_clip - sensor.near_clip - start,
        lens_x=nothing,
        lens_y=nothing,
        lens_start=0.0,
        lens_bend=0.0,
        parallel=True,
    )


def _perspective_rays(sensor: Perspective, film: Film, centre: np.ndarray, radius: float) -> CameraRays:
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
