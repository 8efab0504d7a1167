"""Shapes: what they are made of, what they emit, and which media they divide."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import SceneError
from clvol.scene.curves import read_curves
from clvol.scene.emitter import AreaLight
from clvol.scene.files import find_parameter
from clvol.scene.material_facts import has_textures, needs_uvs
from clvol.scene.materials import Diffuse, FrontOnly
from clvol.scene.mesh_arrays import read_arrays
from clvol.scene.mesh_attributes import with_attributes
from clvol.scene.mesh_files import read_mesh
from clvol.scene.nodes import NAMELESS
from clvol.scene.records import Medium, Mesh, Shape, ShapeMeter
from clvol.scene.transforms import check_size, frame, keeps_angles, scale, stays_round, translate

if TYPE_CHECKING:
    from clvol.scene.materials import Bsdf, Texture
    from clvol.scene.reader import Reader

log = logging.getLogger("clvol")


def cube(reader: Reader) -> Shape:
    """The `cube` plugin, -1..1 along each axis under `to_world`."""
    reader.ignore(face_normals=bool)
    return _shape(reader, "cube", reader.transform())


def rectangle(reader: Reader) -> Shape:
    """The `rectangle` plugin, -1..1 along x and y under `to_world`, facing +z."""
    reader.ignore(face_normals=bool)
    return _shape(reader, "rectangle", reader.transform())


def disk(reader: Reader) -> Shape:
    """The `disk` plugin, of radius 1 and facing +z; `to_world` may make it an ellipse."""
    return _shape(reader, "disk", reader.transform())


def sphere(reader: Reader) -> Shape:
    """The `sphere` plugin; `center` and `radius` apply before `to_world`, which keeps it a sphere."""
    center = reader.vector("center", (0.0, 0.0, 0.0))
    radius = reader.number("radius", 1.0, minimum=0.0, open_interval=True)
    matrix = reader.transform()
    if not keeps_angles(matrix):
        reader.fail(
            "to_world of a sphere must not stretch or shear it",
            "to_world",
            "scale all axes alike (Mitsuba renders a sphere then, not an ellipsoid)",
        )
    return _shape(reader, "sphere", matrix @ translate(center) @ scale(radius))


def cylinder(reader: Reader) -> Shape:
    """The `cylinder` plugin, open at its ends `p0` and `p1`; they and `radius` apply before `to_world`.

    One that emits must stay round: its points are drawn evenly by angle.
    """
    first, last = reader.vector("p0", (0.0, 0.0, 0.0)), reader.vector("p1", (0.0, 0.0, 1.0))
    radius = reader.number("radius", 1.0, minimum=0.0, open_interval=True)
    length = float(np.linalg.norm(last - first))
    if length == 0:
        reader.fail("p0 and p1 are the same point", "p1" if reader.has("p1") else "p0")
    matrix = reader.transform() @ translate(first) @ frame((last - first) / length)
    shape = _shape(reader, "cylinder", matrix @ scale([radius, radius, length]))
    if shape.emission and not stays_round(matrix):
        reader.fail(
            "to_world of a cylinder that emits must not stretch it across or shear it",
            "to_world",
            "scale x and y alike in the cylinder's own frame",
        )
    return shape


def mesh(reader: Reader) -> Shape:
    """The `obj`, `ply`, `serialized`, `stl`, `glb` and `gltf` plugins: the triangles of a file.

    An stl has neither normals nor texture coordinates of its vertices.
    """
    if not reader.has("filename"):
        reader.fail(f"shape '{reader.type}' needs a filename")
    path = find_parameter(reader, "filename")
    flippable = reader.type not in ("stl", "serialized")
    flip = flippable and reader.boolean("flip_tex_coords", reader.type != "ply")
    shape_index = reader.integer("shape_index", 0, 0) if reader.type == "serialized" else 0
    face_normals = reader.boolean("face_normals", False)
    try:
        read, origin = read_mesh(path, reader.type, flip, face_normals, shape_index)
    except ValueError as error:
        name = f" of shape '{reader.node.id}'" if reader.node.id else ""
        reader.fail(f"mesh '{path}'{name}: {error}", "filename")
    return _shape(reader, "mesh", reader.transform() @ translate(origin), read)


def mesh_of_arrays(reader: Reader) -> Shape:
    """Our `mesh` plugin: vertices and faces as arrays, by the names that Mitsuba's meshes have for them."""
    read, origin = read_arrays(reader)
    return _shape(reader, "mesh", reader.transform() @ translate(origin), read)


def curve(reader: Reader) -> Shape:
    """The `bsplinecurve` and `linearcurve` plugins, as tubes of triangles (`clvol.scene.curves`).

    From inside they are not there, as in Mitsuba.
    """
    read, origin = read_curves(reader, reader.transform())
    made = _shape(reader, "mesh", translate(origin), read)
    for name, _ in reader.children("medium"):
        reader.unsupported("curves bound no media: their ends are open", name)
    return replace(made, bsdf=FrontOnly(made.bsdf))


def trianglemesh(reader: Reader) -> Shape:
    """The `trianglemesh` plugin, for readers of other formats: a `Mesh` that is made already, as `mesh`."""
    made = reader.raw("mesh")
    if not isinstance(made, Mesh):
        reader.fail(
            "a trianglemesh needs a mesh that was read from a scene of another format", hint="use ply"
        )
    return _shape(reader, "mesh", reader.transform(), made)


def _shape(reader: Reader, kind: str, to_world: np.ndarray, triangles: Mesh | None = None) -> Shape:
    """A shape with what is inside it.  Without a BSDF it is diffuse, or black if it emits, as in Mitsuba."""
    try:
        check_size(to_world)
    except SceneError as error:
        reader.fail(error.what, hint=error.hint)
    reader.ignore(silhouette_sampling_weight=float)
    media = _media(reader)
    emission = _emission(reader)
    bsdf = reader.only_child("bsdf")
    inside = media.get("interior")
    faulty = reader.library.faults.errors  # one may be that of a BSDF
    if bsdf is None and inside is not None and inside is not media.get("exterior") and not faulty:
        log.warning(
            "%s: the shape has a medium but no BSDF, so it is diffuse and hides the medium; "
            'add <bsdf type="null"/> to look into it',
            reader.node.where,
        )
    made_of: Bsdf = reader.build(bsdf) if bsdf else Diffuse((0.0,) if emission else (0.5,))
    made_of, triangles = with_attributes(reader, made_of, triangles, needs_uvs(emission))
    made = Shape(
        kind,
        to_world,
        interior=media.get("interior"),
        exterior=media.get("exterior"),
        bsdf=made_of,
        emission=emission,
        flip_normals=not reader.type.endswith("curve") and reader.boolean("flip_normals", False),
        mesh=triangles,
        name=reader.node.id,
        meter=_meter(reader, kind, to_world, triangles),
    )
    if triangles is not None and triangles.uvs is None and (has_textures(made.bsdf) or needs_uvs(emission)):
        name = made.name or triangles.source
        log.warning(
            "%s has a texture and no texture coordinates: it shows the texture's (0, 0) all over", name
        )
    return made


def _emission(reader: Reader) -> Texture | None:
    """Radiance of the `area` emitter inside, if there is one."""
    node = reader.only_child("emitter")
    if node is None:
        return None
    light = reader.build(node)
    if not isinstance(light, AreaLight):
        name = next(name for name, _ in reader.children("emitter"))
        reader.fail(f"a shape takes no emitter '{node.type}'", name, "area emitters go into shapes")
    return light.radiance


def _meter(reader: Reader, kind: str, to_world: np.ndarray, triangles: Mesh | None) -> ShapeMeter | None:
    """The `irradiancemeter` inside, if there is one."""
    node = reader.only_child("sensor")
    if node is None:
        return None
    name = reader.children("sensor")[0][0]
    made = reader.build(node)
    if not isinstance(made, ShapeMeter):
        reader.fail(f"a shape takes no sensor '{node.type}'", name, "irradiancemeters go into shapes")
    if triangles is not None and triangles.normals is not None:
        if reader.type.endswith("curve"):
            reader.unsupported("an irradiancemeter on curves", name)
        what = "an irradiancemeter on a mesh with normals of its vertices"
        reader.unsupported(what, name, "set face_normals, or leave its normals out")
    if kind == "cylinder" and not stays_round(to_world):
        reader.fail("a cylinder that is measured must not be stretched across or sheared", name)
    return made if made.name or name.startswith(NAMELESS) else replace(made, name=name)


def _media(reader: Reader) -> dict[str, Medium]:
    """The media behind and before the surface, by the names "interior" and "exterior"."""
    media = {}
    for name, medium in reader.children("medium"):
        if name not in ("interior", "exterior"):
            reader.fail(f"the medium '{name}' of a shape must be its 'interior' or 'exterior'", name)
        media[name] = reader.build(medium)
    return media
