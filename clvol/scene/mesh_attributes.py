"""Textures that show an attribute of their shape: colours of a mesh's vertices or faces.

The device knows bitmaps.  An attribute becomes one of 2 x 2 texels a face: its values a, b and c at the
corners, and b + c - a, with which what is bilinear over the texels is linear over the face.
"""

from __future__ import annotations

import logging
import math
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.scene.material_facts import bsdf_textures, needs_uvs
from clvol.scene.materials import Bitmap, Bsdf, BumpMap, MeshAttribute, NormalMap, Texture
from clvol.scene.sides import bsdf_parts
from clvol.scene.texture import check_texels

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from clvol.scene.reader import Reader
    from clvol.scene.records import Mesh

log = logging.getLogger("clvol")

PREFIXES = ("vertex_", "face_")
"""How the names of attributes begin."""


def mesh_attribute(reader: Reader) -> MeshAttribute:
    """The `mesh_attribute` plugin: the attribute `name` of the shape, times `scale`."""
    if not reader.has("name"):
        reader.fail("a mesh_attribute needs the name of an attribute", hint="as vertex_color")
    name = reader.string("name", "")
    if not name.startswith(PREFIXES):
        reader.fail(f"the name of an attribute begins with vertex_ or face_, not '{name}'", "name")
    return MeshAttribute(name=name, scale=reader.number("scale", 1.0, minimum=0.0))


def with_attributes(
    reader: Reader, bsdf: Bsdf, mesh: Mesh | None, lit_by_texture: bool = False
) -> tuple[Bsdf, Mesh | None]:
    """The BSDF and the mesh of the shape that `reader` reads, with pictures in the place of attributes.

    Attributes are the mesh's, or textures of the shape that have their names.  What nothing shows is dropped.
    `lit_by_texture`: the shape emits by one.
    """
    given = {name: reader.build(node) for name, node in reader.children("texture")}
    wanted = {id(texture): texture for texture in _attributes(bsdf)}
    shown = {texture.name for texture in wanted.values()}
    for name in given.keys() - shown:
        if not name.startswith(PREFIXES):
            reader.refuse_plugin(name)
        log.warning("%s: no mesh_attribute of the shape's BSDF shows '%s'", reader.place(name), name)
    attributes = mesh.attributes if mesh else {}
    mesh = replace(mesh, attributes={}) if attributes and mesh else mesh
    if not wanted:
        return bsdf, mesh
    for name in shown - given.keys() - attributes.keys():
        known = ", ".join([*given, *attributes])
        hint = f"its attributes: {known or 'none'}"
        reader.fail(f"the shape has no attribute '{name}', which its BSDF shows", hint=hint)
    pictures: dict[int, Texture] = {}
    of_mesh = {}
    for key, texture in wanted.items():
        if texture.name not in given:
            of_mesh[key] = texture
        elif isinstance(given[texture.name], MeshAttribute):
            reader.fail(f"the texture '{texture.name}' is itself a mesh_attribute", texture.name)
        elif texture.scale != 1:
            what = f"'scale' of a mesh_attribute that shows the texture '{texture.name}'"
            reader.unsupported(f"{what} is not supported", texture.name)
        else:
            pictures[key] = given[texture.name]
    if mesh is not None and of_mesh:
        _check_alone(reader, bsdf, mesh, lit_by_texture or len(of_mesh) < len(wanted))
        for key, texture in of_mesh.items():
            pictures[key] = _picture(reader, texture, attributes[texture.name], mesh)
        mesh = _apart(mesh)
    return _with(bsdf, pictures), mesh


def _attributes(bsdf: Any) -> list[MeshAttribute]:
    """Those in a BSDF and in what is nested in it."""
    if isinstance(bsdf, MeshAttribute):
        return [bsdf]
    if not is_dataclass(bsdf):
        return []
    return [found for field in fields(bsdf) for found in _attributes(getattr(bsdf, field.name))]


def _parts(bsdf: Any) -> Iterator[Any]:
    """A BSDF, and all that is nested in it."""
    if is_dataclass(bsdf) and not isinstance(bsdf, Bitmap):
        yield bsdf
        for field in fields(bsdf):
            yield from _parts(getattr(bsdf, field.name))


def _with(record: Any, pictures: Mapping[int, Texture]) -> Any:
    """A BSDF with `pictures` in the place of attributes, by their id()."""
    if id(record) in pictures:
        return pictures[id(record)]
    if not is_dataclass(record) or isinstance(record, Bitmap | type):
        return record
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    changed = {name: _with(value, pictures) for name, value in values.items()}
    changed = {name: value for name, value in changed.items() if value is not values[name]}
    return replace(record, **changed) if changed else record


def _check_alone(reader: Reader, bsdf: Bsdf, mesh: Mesh, mixed: bool) -> None:
    """Attributes take the place of texture coordinates: what needs these cannot be in the same BSDF."""
    if any(isinstance(part, NormalMap | BumpMap) for part in _parts(bsdf)):
        reader.unsupported("attributes of a mesh under or in a map of normals or bumps are not supported")
    others = any(needs_uvs(t) and not isinstance(t, MeshAttribute) for t in bsdf_textures(bsdf))
    if others or mixed:
        reader.unsupported(
            "a shape that shows attributes of a mesh and other textures is not supported",
            hint="make the textures attributes too",
        )
    turned = any(
        getattr(part, "alpha_u", 0) is not getattr(part, "alpha_v", 0)
        or getattr(part, "anisotropic", 0) not in (0, (0.0,))
        for part in (side.bsdf for side in bsdf_parts(bsdf))
    )
    if mesh.uvs is not None and turned:
        what = "an anisotropic BSDF that shows attributes of a mesh with texture coordinates is not supported"
        reader.unsupported(what, hint="make it isotropic, or leave the texture coordinates out")


def _picture(reader: Reader, texture: MeshAttribute, values: np.ndarray, mesh: Mesh) -> Bitmap:
    """An attribute, float32 (vertices or faces, 1 or 3), over the texture coordinates of `_apart`."""
    of_faces = texture.name.startswith("face_")
    corners = values[:, None].repeat(3, axis=1) if of_faces else values[mesh.faces]
    with np.errstate(over="ignore"):
        corners = (corners * texture.scale).astype(np.float32)
    corners = np.array(np.broadcast_to(corners, (*corners.shape[:2], 3)))
    if fault := check_texels(corners):
        found, largest = fault.partition("; ")[0], float(corners.max())
        reader.fail(
            f"attribute '{texture.name}' times scale {texture.scale:g}: {found.replace('texels', 'values')}",
            hint=f"the largest is {largest:g}; a scale of {1 / 255:.6g} is for bytes",
        )
    a, b, c = corners.transpose(1, 0, 2)
    columns, rows = _blocks(len(corners))
    blocks = np.zeros((columns * rows, 2, 2, 3), np.float32)
    blocks[: len(corners)] = np.stack([a, b, c, b + c - a], axis=1).reshape(-1, 2, 2, 3)
    pixels = blocks.reshape(rows, columns, 2, 2, 3).transpose(0, 2, 1, 3, 4).reshape(2 * rows, 2 * columns, 3)
    return Bitmap(np.ascontiguousarray(pixels), wrap_mode="clamp", source=f"{mesh.source} {texture.name}")


def _blocks(faces: int) -> tuple[int, int]:
    """Columns and rows of blocks of 2 x 2 texels, as square as may be."""
    columns = max(1, math.isqrt(faces - 1) + 1)
    return columns, -(-faces // columns)


def _apart(mesh: Mesh) -> Mesh:
    """The mesh with vertices of their own for every face, at the centres of its corners' texels."""
    count = len(mesh.faces)
    columns, rows = _blocks(count)
    number = np.arange(count)
    place = np.stack([2 * (number % columns), 2 * (number // columns)], axis=1)[:, None] + 0.5
    uvs = (place + np.array([(0, 0), (1, 0), (0, 1)])) / (2 * columns, 2 * rows)
    vertex = mesh.faces.reshape(-1)
    return replace(
        mesh,
        vertices=mesh.vertices[vertex],
        faces=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        normals=None if mesh.normals is None else mesh.normals[vertex],
        uvs=uvs.reshape(-1, 2).astype(np.float32),
    )
