"""Shapes: closed surfaces that bound a medium."""

from __future__ import annotations

import numpy as np

from clvol.scene.reader import Reader
from clvol.scene.records import Medium, Shape
from clvol.scene.transforms import keeps_angles, scale, translate


def null(reader: Reader) -> str:
    """The `null` BSDF: light passes the surface unchanged."""
    return "null"


def cube(reader: Reader) -> Shape:
    """The `cube` plugin, -1..1 along each axis under `to_world`."""
    reader.ignore("face_normals")
    return _shape(reader, "cube", reader.transform())


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


def _shape(reader: Reader, kind: str, to_world: np.ndarray) -> Shape:
    """A shape with its interior medium, once it is known to have a null BSDF and nothing unsupported."""
    if reader.boolean("flip_normals", False):
        reader.fail("flip_normals is not supported in this version", "flip_normals")
    interior = _interior(reader)
    for name, emitter in reader.children("emitter"):
        reader.build.check_supported(emitter)
        reader.fail(f"a shape takes no emitter '{emitter.type}'", name)
    bsdf = reader.only_child("bsdf")
    if bsdf is None:
        reader.fail(
            f"shape '{reader.type}' without a BSDF is diffuse, which is not supported in this version",
            hint='add <bsdf type="null"/> to make it the boundary of a medium',
        )
    reader.build.build(bsdf)
    return Shape(kind, to_world, interior, name=reader.node.id)


def _interior(reader: Reader) -> Medium | None:
    interior = None
    for name, medium in reader.children("medium"):
        if name == "exterior":
            reader.fail(
                "an exterior medium is not supported in this version",
                name,
                "media that overlap add; the medium round the camera is found from the shapes",
            )
        if name != "interior":
            reader.fail(f"the medium '{name}' of a shape must be its 'interior'", name)
        interior = reader.build.build(medium)
    return interior
