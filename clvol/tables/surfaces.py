"""A scene's surfaces as the device has them: triangles and quadrics in one hierarchy, a record a shape.

Pure functions from records to arrays.  Positions are relative to the scene's centre, taken in double before
they become floats.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from clvol import layout
from clvol.accel.bvh import Bvh, build_bvh, check_mesh, drop_degenerate
from clvol.base.memory import available_memory, format_bytes
from clvol.errors import SceneError
from clvol.scene.boundaries import closed_together
from clvol.scene.extents import shape_bounds
from clvol.scene.material_facts import is_transmissive, passes_light
from clvol.scene.mesh import MAX_INDICES, mesh_flaws
from clvol.scene.orientation import facing_outwards
from clvol.scene.primitives import QUADRICS, mesh_of
from clvol.tables.affine import centred, rows_3x4

if TYPE_CHECKING:
    from clvol.scene import records
    from clvol.scene.boundaries import Boundaries

log = logging.getLogger("clvol")

_CHUNK = 1 << 17
_BYTES_A_VERTEX, _BYTES_A_TRIANGLE = 32, 128
"""Of the arrays here, and of what the hierarchy is built from, at its peak."""
INWARDS = "triangles that face inwards"


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Everything that rays can meet.

    shapes : in the order of the SHAPE records.  table : those records, but for materials and lights.
    vertices : float32 (n, 3).  faces : uint32 (m, 4), three vertices and the number of the shape.
    normals, uvs : float32 (n, 3) and (n, 2), 0 where a mesh has none; None where no mesh has any.
    quadrics : QUADRIC records.  hierarchy : over the faces, then the quadrics.
    """

    shapes: list[records.Shape]
    table: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None
    quadrics: np.ndarray
    hierarchy: Bvh


def prepare_surfaces(scene: records.Scene, found: Boundaries, centre: np.ndarray) -> Surfaces | None:
    """Surfaces of a scene, relative to `centre` (float64 (3,)); None where it has none.

    Raises SceneError for a mesh that cannot be rendered, and warns of one that does not bound its medium.
    """
    shapes = [scene.shapes[index] for index in found.surfaces]
    if not shapes:
        return None
    bits = {index: bit for bit, b in enumerate(found.boundaries) for index in b.shapes}
    shut = closed_together(scene, found)
    table = np.zeros(len(shapes), layout.SHAPE)
    meshes, quadrics, boxes = [], [], []
    for number, (record, shape, index) in enumerate(zip(table, shapes, found.surfaces, strict=True)):
        kind = shape.kind if shape.kind in QUADRICS else "mesh"
        record["kind"] = layout.enum("SURFACE", kind)
        record["flip"] = int(shape.flip_normals)
        record["boundary"] = bits.get(index, -1)
        if index in bits:
            shape = shapes[number] = _outward(shape, index in shut)
        if kind == "mesh":
            meshes.append((number, shape))
            continue
        record["world_from_local"], record["local_from_world"] = _maps(shape, centre)
        quadrics.append((record["local_from_world"], layout.enum("QUADRIC", kind), number))
        lower, upper = shape_bounds(shape)
        boxes.append((lower - centre, upper - centre))
    arrays = _triangles(meshes, table, centre)
    box_array = np.array(boxes, np.float32).reshape(-1, 2, 3)
    hierarchy = build_bvh(arrays[0], arrays[1][:, :3], box_array)
    return Surfaces(shapes, table, *arrays, np.array(quadrics, layout.QUADRIC), hierarchy)


def same_surface(one: records.Shape, other: records.Shape) -> bool:
    """Whether two shapes lie alike in the hierarchy and hold their media alike, whatever they look like."""
    return (
        (one.kind, one.flip_normals, one.name) == (other.kind, other.flip_normals, other.name)
        and (one.to_world is other.to_world and one.mesh is other.mesh)
        and passes_light(one.bsdf) == passes_light(other.bsdf)
        and is_transmissive(one.bsdf) == is_transmissive(other.bsdf)
    )


def with_looks(surfaces: Surfaces, shapes: list[records.Shape]) -> Surfaces:
    """The same surfaces with the materials and the light of `shapes`."""
    pairs = zip(surfaces.shapes, shapes, strict=True)
    return replace(surfaces, shapes=[replace(s, bsdf=t.bsdf, emission=t.emission) for s, t in pairs])


def _maps(shape: records.Shape, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World from local and back, as 12 floats each, relative to the centre."""
    to_world = centred(shape.to_world, centre)
    return rows_3x4(to_world), rows_3x4(np.linalg.inv(to_world))


def _triangles(
    meshes: list[tuple[int, records.Shape]], table: np.ndarray, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Vertices, faces, normals and uvs of all meshes in one; writes into `table` who has the last two."""
    found = [(n, s, mesh_of(s)) for n, s in meshes]
    total = sum(len(m.vertices) for _, _, m in found)
    _check_memory(total, sum(len(m.faces) for _, _, m in found))
    vertices = np.empty((total, 3), np.float32)
    faces = np.empty((sum(len(m.faces) for _, _, m in found), 4), np.uint32)
    normals = np.zeros((total, 3), np.float32) if any(m.normals is not None for _, _, m in found) else None
    uvs = np.zeros((total, 2), np.float32) if any(m.uvs is not None for _, _, m in found) else None
    first = filled = 0
    for number, shape, mesh in found:
        name = shape.name or mesh.source or shape.kind
        here = vertices[first : first + len(mesh.vertices)]
        with np.errstate(over="ignore", invalid="ignore"):
            _transform(mesh.vertices, shape.to_world[:3, :3], shape.to_world[:3, 3] - centre, here)
        check_mesh(here, mesh.faces, name)
        kept, dropped = drop_degenerate(here, mesh.faces)
        if not len(kept):
            raise SceneError(
                "no triangle has an area once it is in the scene: is its to_world too small?", name
            )
        if dropped:
            log.warning("%s: %d triangles without area are left out", name, dropped)
        rows = faces[filled : filled + len(kept)]
        rows[:, :3] = mesh.faces[kept] + first
        if np.linalg.det(shape.to_world[:3, :3]) < 0:
            rows[:, [1, 2]] = rows[:, [2, 1]]  # a mirror turns the winding, and outside stays outside
        rows[:, 3] = number
        table[number]["normals"], table[number]["uvs"] = mesh.normals is not None, mesh.uvs is not None
        if normals is not None and mesh.normals is not None:
            _transform_normals(mesh.normals, shape.to_world[:3, :3], normals[first : first + len(here)])
        if uvs is not None and mesh.uvs is not None:
            uvs[first : first + len(here)] = mesh.uvs
        first += len(here)
        filled += len(kept)
    return vertices, faces[:filled], normals, uvs


def _check_memory(vertices: int, triangles: int) -> None:
    """Raises SceneError for more than can be numbered or held: instances make many of few."""
    needed, free = _BYTES_A_VERTEX * vertices + _BYTES_A_TRIANGLE * triangles, available_memory()
    if max(3 * triangles, vertices) > MAX_INDICES or (free is not None and needed > free):
        what = f"with all instances there are {triangles:,} triangles, which take {format_bytes(needed)}"
        have = "" if free is None else f" and {format_bytes(free)} are free"
        raise SceneError(what + have, hint="use fewer instances, or coarser meshes")


def _transform(points: np.ndarray, linear: np.ndarray, offset: np.ndarray, out: np.ndarray) -> None:
    """In double, piece by piece, so that a large mesh is not copied twice."""
    for start in range(0, len(points), _CHUNK):
        part = slice(start, start + _CHUNK)
        out[part] = points[part].astype(np.float64) @ linear.T + offset


def _transform_normals(normals: np.ndarray, linear: np.ndarray, out: np.ndarray) -> None:
    turned = np.linalg.inv(linear)
    for start in range(0, len(normals), _CHUNK):
        part = slice(start, start + _CHUNK)
        moved = normals[part].astype(np.float64) @ turned
        length = np.linalg.norm(moved, axis=1, keepdims=True)
        out[part] = np.divide(moved, length, out=np.zeros_like(moved), where=length > 0)


def _outward(shape: records.Shape, shut: bool) -> records.Shape:
    """A shape that bounds a medium, closed parts that face inwards turned, with a warning.

    Warns also of a shape that light passes through and that is no closed, outward surface.  shut : together
    with others it is closed.
    """
    if not (passes_light(shape.bsdf) or is_transmissive(shape.bsdf)):
        return shape
    name = shape.name or (shape.mesh.source if shape.mesh else shape.kind)
    if shape.kind in ("rectangle", "disk", "cylinder"):
        flaws = [] if shut else [f"a {shape.kind} is open"]
    elif shape.kind == "sphere":
        flaws = _turned([], shape.flip_normals)
    else:
        if shape.mesh is not None and not shape.flip_normals:
            mesh, turned = facing_outwards(shape.mesh)
            if turned:
                log.warning("%s bounds a medium, but has %s: they are turned", name, INWARDS)
                shape = replace(shape, mesh=mesh)
        flaws = mesh_flaws(mesh_of(shape))
        flaws = _turned(flaws, shape.flip_normals)
    for flaw in flaws:
        log.warning("%s bounds a medium, but %s: the medium may be missing or too large there", name, flaw)
    return shape


def _turned(flaws: list[str], turned: bool) -> list[str]:
    """The flaws of a closed surface once flip_normals has turned it inside out."""
    if not turned:
        return flaws
    if any(INWARDS in flaw for flaw in flaws):
        return []
    return flaws or ["flip_normals turns it inside out"]
