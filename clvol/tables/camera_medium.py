"""The medium that a scene says its camera is in: whether it is there, and whether light reaches it.

A medium that a sensor names and that no boundary holds is everywhere but inside the boundaries that name it
as their exterior (`clvol.scene.boundaries`).  One that boundaries hold must have the camera inside of them:
what a path is in or not in by the way that it took makes no picture.
"""

from __future__ import annotations

import logging

import numpy as np

from clvol.errors import SceneError
from clvol.scene import records
from clvol.scene.boundaries import Boundaries, is_clipped
from clvol.scene.digest import alike
from clvol.scene.primitives import mesh_of
from clvol.tables.camera import camera_rays
from clvol.volumes.grid import SparseGrid

log = logging.getLogger("clvol")

_CHUNK = 1 << 16


def check_camera_medium(scene: records.Scene, found: Boundaries) -> None:
    """Raise SceneError where what the sensor says about its medium cannot be so.

    So it does for a medium without an end whose light is more than it absorbs.  Warns of light from afar that
    such a medium swallows.
    """
    named = scene.camera.medium
    for entry in found.entries:
        if entry.everywhere and _endless(entry.medium):
            _check_far_light(scene, entry.medium)
        if entry.everywhere and not is_clipped(entry.medium):
            _check_glow(scene, entry.medium)
    if named is not None and not _surrounds(scene, found, named):
        raise SceneError(
            f"the sensor names medium{_quoted(named)}, and is not inside of the shapes that hold it",
            scene.source,
            "move the camera into one, turn those that face away (flip_normals), or drop the sensor's medium",
        )


def _quoted(medium: records.Medium) -> str:
    return f" '{medium.name}'" if medium.name else ""


def _endless(medium: records.Medium) -> bool:
    """Whether it reaches infinity, with some density there, where nothing bounds it."""
    if is_clipped(medium) or not any(medium.scale):
        return False
    if isinstance(medium.sigma_t, records.ConstVolume):
        return any(medium.sigma_t.value)
    if not isinstance(medium.sigma_t.grid, SparseGrid):
        return False
    transfer = medium.transfer("sigma_t")
    if transfer is not None:
        return bool(transfer(np.array(medium.sigma_t.grid.background)).max() > 0)
    return not medium.sigma_t.grid.clear_outside


def _check_far_light(scene: records.Scene, medium: records.Medium) -> None:
    """Nothing that comes from infinity gets through an endless medium.

    Mitsuba has it come from a sphere round the shapes instead, and its integrators then disagree: where the
    sensor names the medium the same file would mean another picture, so that is refused.
    """
    far = {
        records.ConstantEmitter: "constant",
        records.EnvmapEmitter: "envmap",
        records.DirectionalEmitter: "directional",
    }
    names = [far[type(emitter)] for emitter in scene.emitters if type(emitter) in far]
    if not names:
        return
    what = f"no light of '{names[0]}' gets through medium{_quoted(medium)}, which has no end"
    hint = "bound it by a shape round everything: its interior, with a null BSDF"
    if alike(medium, scene.camera.medium):
        raise SceneError(f"{what}: the sensor is in it, and no shape holds it", scene.source, hint)
    log.warning("%s: it is only ever the exterior of shapes; %s", what, hint)


def _check_glow(scene: records.Scene, medium: records.Medium) -> None:
    """Where a medium without an end absorbs nothing, its glow adds up to infinity."""
    if not medium.glows:
        return
    glow, absorbed = np.broadcast_to(np.array(medium.emission_density_scale), 3), np.array(medium.scale)
    if isinstance(medium.emission_density, records.ConstVolume):
        glow = glow * medium.emission_density.value
    if isinstance(medium.sigma_t, records.ConstVolume):
        absorbed = absorbed * medium.sigma_t.value
    if isinstance(medium.albedo, records.ConstVolume):
        absorbed = absorbed * (1 - np.array(medium.albedo.value))
    if not _endless(medium) or ((glow > 0) & (np.broadcast_to(absorbed, 3) == 0)).any():
        raise SceneError(
            f"medium{_quoted(medium)} has no end and emits what it does not absorb: it is infinitely bright",
            scene.source,
            "bound it by a shape round everything: its interior, with a null BSDF",
        )


def _surrounds(scene: records.Scene, found: Boundaries, medium: records.Medium) -> bool:
    """Whether rays through the middle and the corners of the picture all start in the medium."""
    rays = camera_rays(scene.camera, scene.film, np.zeros(3), np.inf)
    width, height = scene.film.window[2:]
    pixels = np.array([(0.5, 0.5), (0, 0), (1, 0), (0, 1), (1, 1)]) * (width, height)
    starts = rays.position + pixels[:, :1] * rays.dx + pixels[:, 1:] * rays.dy
    towards = rays.base + pixels[:, :1] * rays.base_dx + pixels[:, 1:] * rays.base_dy
    presence = np.zeros(len(pixels), int)
    for number, entry in enumerate(found.entries):
        if not alike(entry.medium, medium):
            continue
        presence += int(entry.everywhere)
        if entry.shape is not None:
            presence += starts_inside([entry.shape], starts, towards)
        for boundary in found.boundaries:
            sign = int(boundary.interior == number) - int(boundary.exterior == number)
            if sign:
                presence += sign * starts_inside(boundary.of(scene), starts, towards)
    return bool((presence > 0).all())


def starts_inside(shapes: list[records.Shape], starts: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Whether rays (n, 3), (n, 3) start behind a surface of these shapes: their first crossing leads out."""
    nearest, behind = np.full(len(starts), np.inf), np.zeros(len(starts), bool)
    for shape in shapes:
        t, outwards = _first_crossing(shape, starts, towards)
        behind = np.where(t < nearest, outwards != shape.flip_normals, behind)
        nearest = np.minimum(t, nearest)
    return behind


def _first_crossing(
    shape: records.Shape, starts: np.ndarray, towards: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance, inf where there is none, and whether it leads to the shape's front."""
    inverse = np.linalg.inv(shape.to_world)
    o, d = starts @ inverse[:3, :3].T + inverse[:3, 3], towards @ inverse[:3, :3].T
    if shape.kind == "disk":
        return _disk(o, d)
    if shape.kind in ("sphere", "cylinder"):
        return _round(shape.kind, o, d)
    return _triangles(mesh_of(shape), o, d)


def _disk(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the first crossing, inf where there is none, and whether it leads to the front."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -o[:, 2] / d[:, 2]
        met = (t > 0) & (((o + t[:, None] * d)[:, :2] ** 2).sum(1) <= 1)
    return np.where(met, t, np.inf), d[:, 2] > 0


def _round(kind: str, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same for the unit sphere, and for the open cylinder of radius 1 and z in 0..1."""
    axes = slice(3) if kind == "sphere" else slice(2)
    p, v = o[:, axes], d[:, axes]
    a, b, c = (v * v).sum(1), (p * v).sum(1), (p * p).sum(1) - 1
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.sqrt(b * b - a * c)
        t = np.stack([-b - half, -b + half]) / a
        z = o[:, 2] + t * d[:, 2]
        met = (t > 0) & ((kind == "sphere") | ((z >= 0) & (z <= 1)))
    t = np.where(met, t, np.inf)
    return t.min(axis=0), t[1] < t[0]


def _triangles(mesh: records.Mesh, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same for a mesh, ray by ray (Möller and Trumbore 1997)."""
    nearest, outwards = np.full(len(o), np.inf), np.zeros(len(o), bool)
    for first in range(0, len(mesh.faces), _CHUNK):
        a, b, c = mesh.vertices[mesh.faces[first : first + _CHUNK]].astype(np.float64).transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        for ray in range(len(o)):
            with np.errstate(divide="ignore", invalid="ignore"):
                along, from_a = normal @ d[ray], o[ray] - a
                t = -(normal * from_a).sum(1) / along
                q = np.cross(from_a, d[ray])
                u, v = (q * (c - a)).sum(1) / -along, (q * (b - a)).sum(1) / along
                t = np.where((t > 0) & (u >= 0) & (v >= 0) & (u + v <= 1), t, np.inf)
            hit = int(t.argmin())
            if t[hit] < nearest[ray]:
                nearest[ray], outwards[ray] = t[hit], along[hit] > 0
    return nearest, outwards
