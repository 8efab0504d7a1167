"""Media that are thin beside the scene: what single precision leaves of them.  Pure NumPy."""

from __future__ import annotations

import logging

import numpy as np

from clvol.errors import SceneError
from clvol.scene import records
from clvol.scene.boundaries import Boundaries, MediumEntry, is_clipped, scene_sphere
from clvol.scene.extents import shape_bounds
from clvol.scene.medium_facts import medium_volumes
from clvol.scene.primitives import mesh_of

log = logging.getLogger("clvol")

THIN = 2.0**-12
"""Share of the way from the camera below which a medium is thin: entry and exit, each rounded, would be off
by half a thousandth of the way between them."""

LOST = 2.0**-16
"""Share of a coordinate, or of a way, that is rounded to about a hundredth of itself."""


def bounding_boxes(entry: MediumEntry) -> list[np.ndarray]:
    """What bounds a medium's span of a ray: maps of the cube (-1..1)³ to world space, float64 (4, 4)."""
    boxes, sigma_t = [], entry.medium.sigma_t
    if entry.shape is not None:
        boxes.append(entry.shape.to_world)
    if is_clipped(entry.medium):
        if isinstance(sigma_t, records.GridVolume):
            to_world, lower, upper = sigma_t.index_to_world, sigma_t.lower, sigma_t.upper
        else:
            to_world, lower, upper = sigma_t.to_world, np.zeros(3), np.ones(3)
        in_box = np.diag([*(upper - lower) / 2, 1.0])
        in_box[:3, 3] = (lower + upper) / 2
        boxes.append(to_world @ in_box)
    return boxes


def widths(box: np.ndarray) -> np.ndarray:
    """Distances between the opposite faces of such a box, float64 (3,)."""
    distances: np.ndarray = 2 / np.linalg.norm(np.linalg.inv(box)[:3, :3], axis=1)
    return distances


def thin_media(scene: records.Scene, found: Boundaries) -> list[bool]:
    """Whether each medium is so thin that rays are measured from a point close to it.

    It is where a shape or box that bounds it in closed form is thinner than THIN of what rays travel.  What
    surfaces bound is measured where rays meet them.
    """
    centre, radius = scene_sphere(scene, found)
    reach = radius + float(np.linalg.norm(scene.camera.to_world[:3, 3] - centre))
    return [
        min((widths(box).min() for box in bounding_boxes(entry)), default=np.inf) < THIN * reach
        for entry in found.entries
    ]


def check_thinness(scene: records.Scene, found: Boundaries) -> None:
    """Refuse media in which places are lost to rounding, and warn of boundaries that are.

    Raises SceneError for a medium that scatters or varies, in a shape or box thinner than LOST of its own
    coordinates, which count from the scene's centre.  Transmittance through a uniform medium needs no places.
    """
    centre, _ = scene_sphere(scene, found)
    for entry in found.entries:
        for box in bounding_boxes(entry) if _needs_places(entry.medium) else ():
            shares = widths(box) / _coordinates(box, centre)
            if shares.min() < LOST:
                raise SceneError(
                    f"a medium {widths(box).min():.3g} thick is too thin to scatter or vary, so far from the "
                    "scene's centre",
                    entry.medium.name or "the medium",
                    f"make it thicker than {widths(box).min() * LOST / shares.min():.3g}, or everything else "
                    "smaller or evenly placed round it",
                )
    eye = scene.camera.to_world[:3, 3]
    for boundary, shape in ((b, shape) for b in found.boundaries for shape in b.of(scene)):
        lower, upper = shape_bounds(shape)
        way = np.linalg.norm(np.maximum(np.maximum(lower - eye, eye - upper), 0))
        way = max(way, np.abs(lower - centre).max(), np.abs(upper - centre).max())
        chord = mean_chord(shape) if boundary.interior >= 0 else np.inf
        if 0 < chord < LOST / 4 * way:  # a few hundredths are lost
            log.warning(
                "%s bounds a medium and is %.3g thick, too thin to be measured from %.3g away: what it "
                "absorbs is uncertain; a cube or sphere without a surface is measured from close by",
                *(shape.name or shape.kind, chord, way),
            )


def _needs_places(medium: records.Medium) -> bool:
    if medium_volumes(medium):
        return True
    return isinstance(medium.albedo, records.ConstVolume) and max(medium.albedo.value) > 0


def _coordinates(box: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Magnitude of the coordinates that a place across each pair of faces is computed from, float64 (3,)."""
    across = np.abs(np.linalg.inv(box)[:3, :3])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    magnitudes: np.ndarray = across @ (np.abs(box[:3, 3] - centre) + np.abs(box[:3, :3]).sum(axis=1))
    return magnitudes


def mean_chord(shape: records.Shape) -> float:
    """Mean length of rays through a closed convex shape: four times its volume over its area (Cauchy).

    It is 0 for one without an inside.
    """
    linear = shape.to_world[:3, :3]
    if shape.kind == "sphere":
        return float(4 / 3 * np.linalg.svd(linear, compute_uv=False).min())
    if shape.kind not in ("cube", "mesh"):
        return 0.0
    mesh = mesh_of(shape)
    corners = (mesh.vertices.astype(float) @ linear.T)[mesh.faces]
    corners -= corners[0, 0]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1).sum() / 2
    return float(4 * abs(np.einsum("ij,ij->", normals, corners[:, 0])) / 6 / area) if area > 0 else 0.0
