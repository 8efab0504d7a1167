"""Which shapes are surfaces that rays meet, and what bounds each medium.

A cube or sphere without a surface that only holds a medium is no surface: its medium is a *span* of
a ray, worked out afresh for every ray.  Every other shape with media is a *boundary*, or a piece of one:
a path carries one bit for each, set while it is inside, and a medium is present as often as boundaries that
hold it, less those that name it as their exterior, say (METHODS §6).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from clvol.scene import records
from clvol.scene.digest import alike, outline
from clvol.scene.extents import CLOSED, bounds_of, is_piece, openness, shape_bounds
from clvol.scene.materials import Null

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

CONVEX = ("cube", "sphere")
"""Kinds of shape that a ray meets in one span, found in closed form."""
GOES_ROUND = 0.5
"""Openness below which shapes go round a place, as a cup does."""


@dataclass(frozen=True, eq=False)
class MediumEntry:
    """One medium as the device knows it.

    shape : the shape whose span bounds it, or None where boundaries do.
    everywhere : it fills all that no boundary takes away: a medium that is only ever an exterior, or that the
        sensor names, or both sides of a surface, and no shape holds.
    """

    medium: records.Medium
    shape: records.Shape | None = None
    everywhere: bool = False


@dataclass(frozen=True)
class Boundary:
    """A surface that divides media: the indices of its shapes among the scene's, and entries (-1: none).

    Closed shapes are each a surface of its own, and so are meshes with holes; all pieces that divide the same
    media are one together, as the walls of a room: light that enters by one leaves by another.
    """

    shapes: tuple[int, ...]
    interior: int
    exterior: int

    def of(self, scene: records.Scene) -> list[records.Shape]:
        """Its shapes."""
        return [scene.shapes[index] for index in self.shapes]


@dataclass(frozen=True, eq=False)
class Boundaries:
    """How a scene's shapes are used.

    surfaces : indices of the shapes that rays meet, in the scene's order.
    entries : the media.  boundaries : in the order of their bits.
    """

    surfaces: tuple[int, ...]
    entries: tuple[MediumEntry, ...]
    boundaries: tuple[Boundary, ...]

    @property
    def words(self) -> int:
        """32-bit words that hold a path's bits."""
        return -(-len(self.boundaries) // 32)

    def masks(self) -> np.ndarray:
        """uint32 (entries, 2, words): for each medium, the boundaries that hold it, and that keep it out."""
        found = np.zeros((len(self.entries), 2, self.words), np.uint32)
        for bit, boundary in enumerate(self.boundaries):
            for side, entry in enumerate((boundary.interior, boundary.exterior)):
                if entry >= 0:
                    found[entry, side, bit // 32] |= np.uint32(1 << (bit % 32))
        return found


def find_boundaries(scene: records.Scene) -> Boundaries:
    """Sort a scene's shapes into surfaces, spans and boundaries; a pure function of the records."""
    shapes, one = scene.shapes, _one_of_each(scene)
    sides = [(one.get(id(s.interior)), one.get(id(s.exterior))) for s in shapes]
    divides = [inside is not outside for inside, outside in sides]
    pairs = [media for media, does in zip(sides, divides, strict=True) if does]
    exteriors = {id(outside) for _, outside in pairs if outside is not None}
    holders = Counter(id(inside) for inside, _ in pairs if inside is not None)
    entries: list[MediumEntry] = []
    entry_of: dict[int, int] = {}  # of media that boundaries name
    surfaces, dividing = [], []
    for index, (shape, (inside, outside)) in enumerate(zip(shapes, sides, strict=True)):
        counted = id(inside) in exteriors and holders[id(inside)] > 1  # what several hold and others keep out
        if inside is not None and outside is None and not counted and _is_interval(shape):
            if id(inside) in exteriors:
                entry_of[id(inside)] = len(entries)
            entries.append(MediumEntry(inside, shape))
            continue
        if divides[index]:
            dividing.append(index)
        if divides[index] or shape.emission is not None or not isinstance(shape.bsdf, Null):
            surfaces.append(index)
    for index in dividing:
        for medium in sides[index]:
            if medium is not None and id(medium) not in entry_of:
                entry_of[id(medium)] = len(entries)
                entries.append(MediumEntry(medium, None, id(medium) not in holders))
    known = {id(entry.medium) for entry in entries}
    around = [inside for (inside, _), does in zip(sides, divides, strict=True) if not does]
    for medium in (*around, one.get(id(scene.camera.medium))):
        if medium is not None and id(medium) not in known:
            known.add(id(medium))
            entries.append(MediumEntry(medium, None, True))
    numbers = {index: tuple(-1 if m is None else entry_of[id(m)] for m in sides[index]) for index in dividing}
    boundaries = tuple(Boundary(tuple(parts), *numbers[parts[0]]) for parts in _surfaces_of(shapes, numbers))
    return Boundaries(tuple(surfaces), tuple(entries), boundaries)


def _one_of_each(scene: records.Scene) -> dict[int, records.Medium]:
    """By `id` of each medium, the first of those alike: what a lamp and a ball say of the air they stand in.

    Media that neither an exterior nor the sensor names stay as they are: clouds that are alike add.
    """
    named = [medium for shape in scene.shapes for medium in (shape.interior, shape.exterior)]
    media = {id(medium): medium for medium in (*named, scene.camera.medium) if medium is not None}
    outer = {id(shape.exterior) for shape in scene.shapes} | {id(scene.camera.medium)}
    if len(media) < 2 or not outer & media.keys():
        return media
    found: dict[str, list[list[records.Medium]]] = {}
    for medium in media.values():
        groups = found.setdefault(outline(medium), [])
        group = next((group for group in groups if alike(group[0], medium)), None)
        if group is None:
            groups.append([medium])
        else:
            group.append(medium)
    for group in chain.from_iterable(found.values()):
        if any(id(medium) in outer for medium in group):
            media |= dict.fromkeys(map(id, group), group[0])
    return media


def _surfaces_of(shapes: Sequence[records.Shape], sides: dict[int, tuple[int, ...]]) -> Iterable[list[int]]:
    """The shapes that divide media, by the surfaces that they make up, in the order of their first ones."""
    count = Counter(sides.values())
    surfaces: dict[object, list[int]] = {}  # of pieces by the media that they divide, else by their number
    for index, media in sides.items():
        key = media if count[media] > 1 and is_piece(shapes[index]) else index
        surfaces.setdefault(key, []).append(index)
    return surfaces.values()


def _is_interval(shape: records.Shape) -> bool:
    """Whether what the shape holds, if it does no more, is in one span of any ray."""
    return (
        shape.kind in CONVEX
        and isinstance(shape.bsdf, Null)
        and shape.emission is None
        and not shape.flip_normals
    )


def is_clipped(medium: records.Medium) -> bool:
    """Whether the box of the sigma_t volume bounds the medium beside its shape."""
    if medium.homogeneous:
        return False
    return not isinstance(medium.sigma_t, records.GridVolume) or medium.sigma_t.clipped


def _naming(found: Boundaries, side: str) -> dict[int, list[Boundary]]:
    """The boundaries that have each medium as their `interior`, or `exterior`, by the number of its entry."""
    named: dict[int, list[Boundary]] = {number: [] for number in range(-1, len(found.entries))}
    for boundary in found.boundaries:
        named[getattr(boundary, side)].append(boundary)
    return named


def entry_bounds(scene: records.Scene, found: Boundaries) -> list[tuple[np.ndarray, np.ndarray]]:
    """World bounds of each medium: of the shape, or of all boundaries that hold it.

    They are infinite where a medium is everywhere.  What open shapes hold, as the front of a room of
    rectangles, reaches as far as all that name it, or as the whole scene where these do not go round it, as
    the surface of a lake.
    """
    boxes, holders, keepers = [], _naming(found, "interior"), _naming(found, "exterior")
    for number, entry in enumerate(found.entries):
        if entry.everywhere:
            boxes.append((np.full(3, -np.inf), np.full(3, np.inf)))
            continue
        parts = [] if entry.shape is None else [entry.shape]
        parts += [shape for b in holders[number] for shape in b.of(scene)]
        if openness(parts) > CLOSED:
            outer = [shape for b in keepers[number] for shape in b.of(scene)]
            parts = parts + outer if openness(parts, outer) < GOES_ROUND else _all_shapes(scene, found)
        boxes.append(bounds_of(parts))
    return boxes


def closed_together(scene: records.Scene, found: Boundaries) -> set[int]:
    """Indices of shapes that bound media together with others, without a gap, as the walls of a room."""
    holders, keepers = _naming(found, "interior"), _naming(found, "exterior")
    gaps, named = set(), set()
    for number in range(len(found.entries)):
        sides = [[s for b in named_by[number] for s in b.of(scene)] for named_by in (holders, keepers)]
        indices = {index for b in (*holders[number], *keepers[number]) for index in b.shapes}
        named |= indices
        if openness(*sides) > CLOSED:
            gaps |= indices
    return named - gaps


def _all_shapes(scene: records.Scene, found: Boundaries) -> list[records.Shape]:
    """All that rays can meet: surfaces, and media in their spans."""
    shapes = [scene.shapes[n] for n in found.surfaces]
    return shapes + [e.shape for e in found.entries if e.shape is not None]


def scene_sphere(scene: records.Scene, found: Boundaries) -> tuple[np.ndarray, float]:
    """Centre and radius of a sphere round all that rays can meet, every medium and surface.

    The camera's place where there is nothing.
    """
    shapes = _all_shapes(scene, found)
    if not shapes:
        return scene.camera.to_world[:3, 3].copy(), 1.0
    lower, upper = bounds_of(shapes)
    return (lower + upper) / 2, float(np.linalg.norm(upper - lower)) / 2


def may_overlap(scene: records.Scene, found: Boundaries) -> bool:
    """Whether two media may be present at one point; conservative.

    They cannot where their bounds are apart, or where all that holds the one keeps out the other.
    """
    boxes = np.array(entry_bounds(scene, found)).reshape(-1, 2, 3)
    lower, upper, holders = boxes[:, 0], boxes[:, 1], _naming(found, "interior")
    for a in range(len(boxes)):
        meet = ((lower[a] < upper[:a]) & (lower[:a] < upper[a])).all(axis=1)
        for b in np.flatnonzero(meet).tolist():
            if not (_replaces(found, holders, a, b) or _replaces(found, holders, b, a)):
                return True
    return False


def _replaces(found: Boundaries, holders: dict[int, list[Boundary]], inner: int, outer: int) -> bool:
    """Whether every boundary of `inner` has `outer` as its exterior, and outer is held once at any point."""
    entry = found.entries[outer]
    held_once = entry.everywhere or entry.shape is not None or len(holders[outer]) == 1
    only = found.entries[inner].shape is None and bool(holders[inner])
    return only and held_once and all(b.exterior == outer for b in holders[inner])


def camera_may_be_inside(scene: records.Scene, found: Boundaries) -> bool:
    """Conservative: whether rays may start within a boundary's bounds."""
    low, high = _starts_of_rays(scene.camera, scene.film)
    for boundary in found.boundaries:
        lower, upper = bounds_of(boundary.of(scene))
        if (high >= lower).all() and (low <= upper).all():
            return True
    return False


def _starts_of_rays(sensor: records.Camera, film: records.Film) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a box round all places where camera rays start."""
    width, height = film.width, film.height
    if isinstance(sensor, records.Orthographic):
        corners = sensor.at([0, width, 0, width], [0, 0, height, height], film)
        aside = np.ptp(corners, axis=0)  # filters may reach beyond the film
        return corners.min(axis=0) - aside, corners.max(axis=0) + aside
    if isinstance(sensor, records.Meter) and sensor.distant:
        return np.full(3, np.inf), np.full(3, -np.inf)  # outside of all
    if isinstance(sensor, records.IrradianceMeter):
        return shape_bounds(sensor.shape)
    eye = sensor.to_world[:3, 3]
    if isinstance(sensor, records.Meter):
        return eye, eye
    tangent = np.tan(np.radians(sensor.fov) / 2) * max(width / height, height / width)
    aside = tangent * (2 + 2 * max(map(abs, sensor.principal_point_offset)))
    near_point = sensor.near_clip * (1 + 2 * aside)  # the farthest point of the near plane in view
    reach = near_point + sensor.aperture_radius * (1 + sensor.near_clip / sensor.focus_distance)
    return eye - reach, eye + reach
