"""Where one camera ray meets media, as the renderer's own kernels find it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.errors import OptionError
from clvol.scene.boundaries import entry_bounds
from clvol.scene.material_facts import is_transmissive, passes_light
from clvol.scene.materials import Null
from clvol.tables.apart import peak_extinction
from clvol.tables.camera import CameraRays, camera_rays, reach_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.lab.ray.kernels import RayKernels
    from clvol.tables.prepare import PreparedScene

MOST_SURFACES = 64
"""Surfaces that a ray may pass before it meets a medium."""
SHOWN_RADII = 4.0
"""Of a medium without an end so many radii of the scene are shown."""


@dataclass(frozen=True, eq=False)
class Place:
    """The segment of a ray inside one medium.

    origin, direction : float64 (3,), the medium's entry relative to the scene's centre; unit vector.
    distance : of the entry from the camera.  length : of the segment.
    medium : number of its entry among the scene's boundaries.  presence : how often it is present there.
    notes : what a viewer has to know, a sentence each.
    """

    origin: np.ndarray
    direction: np.ndarray
    distance: float
    length: float
    medium: int
    presence: int
    notes: tuple[str, ...]


def check_pixel(prepared: PreparedScene, x: int, y: int) -> None:
    """OptionError for a pixel outside the picture."""
    width, height = prepared.scene.film.window[2:]
    if not (0 <= x < width and 0 <= y < height):
        raise OptionError(
            f"pixel ({x}, {y}) is outside the picture, which has {width} x {height} pixels",
            hint=f"x is 0 to {width - 1}, from the left; y is 0 to {height - 1}, from the top",
        )


class _Segment(NamedTuple):
    """One medium between two distances, how often it is present there, and notes."""

    medium: int
    presence: int
    start: float
    end: float
    notes: tuple[str, ...]


def find_places(kernels: RayKernels, x: int, y: int) -> list[Place]:
    """The media on the ray through the centre of pixel (x, y), in the order of entry.

    They end at a surface that no light passes.

    Raises
    ------
    OptionError : the pixel is outside the picture, or its ray meets no medium.
    """
    prepared = kernels.prepared
    check_pixel(prepared, x, y)
    rays = _camera_rays(prepared)
    origin = rays.position + (x + 0.5) * rays.dx + (y + 0.5) * rays.dy
    direction = rays.base + (x + 0.5) * rays.base_dx + (y + 0.5) * rays.base_dy
    direction = direction / np.linalg.norm(direction)
    far = rays.far / float(direction @ rays.forward)
    to_origin = rays.distance(origin)
    hits, spans = kernels.places(origin, direction, MOST_SURFACES)
    places = []
    for segment in _segments(prepared, hits, spans, far):
        end, notes = segment.end, segment.notes
        if np.isinf(end):
            end = segment.start + SHOWN_RADII * prepared.radius
            notes = (*notes, "The medium has no end; only its beginning is shown.")
        entry = origin + segment.start * direction
        length, distance = end - segment.start, to_origin + segment.start
        places.append(Place(entry, direction, distance, length, segment.medium, segment.presence, notes))
    if not places:
        raise OptionError(
            f"the ray through pixel ({x}, {y}) meets no medium before a surface stops it"
            if len(hits)
            else f"the ray through pixel ({x}, {y}) meets no medium",
            hint=pixel_hint(prepared, x, y),
        )
    return places


def _camera_rays(prepared: PreparedScene) -> CameraRays:
    everywhere = any(entry.everywhere for entry in prepared.boundaries.entries)
    scene = prepared.scene
    reach = reach_of(scene.camera, prepared.radius, everywhere)
    return camera_rays(scene.camera, scene.film, prepared.centre, reach)


def _segments(prepared: PreparedScene, hits: np.ndarray, spans: np.ndarray, far: float) -> Iterator[_Segment]:
    """The segments of the ray in media, in the order of entry.

    hits : float (n, 3), t, surface and whether it is entered.  spans : float (media, 2).
    """
    bits, start = _bits_at_start(prepared, hits), 0.0
    notes: list[str] = []
    for number in range(len(hits) + 1):
        end = float(hits[number, 0]) if number < len(hits) else np.inf
        presence = _presence(prepared, bits)
        found = sorted(
            (max(start, t0), m, min(end, t1, far))
            for m, (t0, t1) in enumerate(spans.tolist())
            if presence[m] > 0 and max(start, t0) < min(end, t1, far)
        )
        for first, medium, last in found:
            others = sum(t0 < last and first < t1 for t0, _, t1 in found) - 1
            overlap = [f"{others} more media overlap this one, and are not shown."] if others else []
            yield _Segment(medium, int(presence[medium]), first, last, (*notes, *overlap))
        if number == len(hits) or prepared.surfaces is None:
            return
        surface = int(hits[number, 1])
        bsdf = prepared.surfaces.shapes[surface].bsdf
        if not (is_transmissive(bsdf) or passes_light(bsdf)):
            return
        if not isinstance(bsdf, Null):
            notes[:] = ["The ray is drawn straight through the surfaces before the medium."]
        boundary = int(prepared.surfaces.table["boundary"][surface])
        if boundary >= 0:
            bits[boundary] = bool(hits[number, 2])
        start = end


def _bits_at_start(prepared: PreparedScene, hits: np.ndarray) -> np.ndarray:
    """Whether the ray starts inside of each boundary: where its first crossing leads out."""
    bits = np.zeros(len(prepared.boundaries.boundaries), bool)
    if prepared.surfaces is None:
        return bits
    for _, surface, enters in hits[::-1]:
        boundary = int(prepared.surfaces.table["boundary"][int(surface)])
        if boundary >= 0:
            bits[boundary] = not enters
    return bits


def _presence(prepared: PreparedScene, bits: np.ndarray) -> np.ndarray:
    """How often each medium is present inside these boundaries."""
    entries = prepared.boundaries.entries
    presence = np.array([int(e.shape is not None or e.everywhere) for e in entries], int)
    for boundary, inside in zip(prepared.boundaries.boundaries, bits, strict=True):
        if inside and boundary.interior >= 0:
            presence[boundary.interior] += 1
        if inside and boundary.exterior >= 0:
            presence[boundary.exterior] -= 1
    return presence


def pixel_hint(prepared: PreparedScene, x: int, y: int) -> str:
    """Another pixel than (x, y), towards the middle of a medium, where one is in the picture."""
    empty = [_is_empty(prepared, number) for number in range(len(prepared.boundaries.entries))]
    if all(empty):
        return "the scene has no density anywhere"
    rays = _camera_rays(prepared)
    width, height = prepared.scene.film.window[2:]
    bounds = entry_bounds(prepared.scene, prepared.boundaries)
    for is_empty, (lower, upper) in zip(empty, bounds, strict=True):
        if is_empty or not np.isfinite([lower, upper]).all():
            continue
        across, down, depth = rays.place((lower + upper) / 2 - prepared.centre)
        if not (depth > 0 and 0 <= across < width and 0 <= down < height):
            continue
        middle = int(across), int(down)
        if middle != (x, y):
            return f"try {middle[0]} {middle[1]}, towards the middle of a medium"
    return "choose a pixel where the picture shows a medium"


def _is_empty(prepared: PreparedScene, entry: int) -> bool:
    """Whether the density of an entry's medium is 0 everywhere."""
    number = prepared.matter.of_entry[entry]
    return not np.any(peak_extinction(prepared.matter.media[number], prepared.density(number)))
