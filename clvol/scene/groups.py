"""Shapes that stand for others: groups, instances of them, and meshes that Mitsuba merges.

An instance is its group's shapes under another transform: they share the meshes, materials and media of the
records.  The device has them all in world space, so what is instanced often takes memory there
(`clvol.tables.surfaces` says when it is too much).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from clvol.errors import SceneError
from clvol.scene.records import Shape
from clvol.scene.transforms import check_size

if TYPE_CHECKING:
    from collections.abc import Iterable

    from clvol.scene.reader import Reader

log = logging.getLogger("clvol")


@dataclass(frozen=True, eq=False)
class ShapeGroup:
    """Shapes that are seen where instances put them, and nowhere else."""

    shapes: tuple[Shape, ...]


ShapeRecord = Shape | ShapeGroup | tuple[Shape, ...]
"""What the plugins of shapes make."""


def shapegroup(reader: Reader) -> ShapeGroup:
    """The `shapegroup` plugin.  As in Mitsuba its shapes may not emit, and hold no instances.

    A `to_world` of its own changes nothing there, and is warned of.
    """
    if reader.has("to_world"):
        reader.transform()
        log.warning(
            "%s: a shapegroup's to_world changes nothing, as in Mitsuba", reader.node.place("to_world")
        )
    reader.ignore(silhouette_sampling_weight=float)
    found: list[Shape] = []
    for name, node in reader.children("shape"):
        if node.type == "instance":
            reader.fail("a shapegroup holds no instances", name, "put its shapes there instead")
        shapes = shapes_of(reader.build(node))
        if any(shape.emission for shape in shapes):
            reader.fail("a shape in a shapegroup cannot emit", name, "put the light outside of the group")
        _refuse_meters(reader, name, shapes)
        found += shapes
    return ShapeGroup(tuple(found))


def instance(reader: Reader) -> tuple[Shape, ...]:
    """The `instance` plugin: the shapes of a group under `to_world`, which may stretch and mirror them."""
    reader.ignore(silhouette_sampling_weight=float)
    nodes = reader.children("shape")
    group = reader.build(nodes[0][1]) if len(nodes) == 1 else None
    if not isinstance(group, ShapeGroup):
        reader.fail("an instance needs one shapegroup", nodes[-1][0] if nodes else "", "refer to its id")
    matrix = reader.transform()
    shapes = []
    for shape in group.shapes:
        to_world = matrix @ shape.to_world
        try:
            check_size(to_world)
        except SceneError as error:
            reader.fail(error.what, "to_world", error.hint)
        shapes.append(replace(shape, to_world=to_world, name=reader.node.id))
    return tuple(shapes)


def merge(reader: Reader) -> tuple[Shape, ...]:
    """The `merge` plugin: the shapes in it, which Mitsuba joins to fewer meshes that look the same."""
    found: list[Shape] = []
    for name, node in reader.children("shape"):
        shapes = shapes_of(reader.build(node))
        _refuse_meters(reader, name, shapes)
        found += shapes
    return tuple(found)


def _refuse_meters(reader: Reader, name: str, shapes: tuple[Shape, ...]) -> None:
    """No sensor is in the scene that is in a shape of a group."""
    if any(shape.meter for shape in shapes):
        hint = "put the shape into the scene"
        reader.fail(f"a shape in a {reader.type} takes no irradiancemeter", name, hint)


def shapes_of(record: ShapeRecord) -> tuple[Shape, ...]:
    """The shapes of a plugin that are seen where it stands."""
    if isinstance(record, Shape):
        return (record,)
    return () if isinstance(record, ShapeGroup) else record


def all_shapes(records: Iterable[ShapeRecord]) -> tuple[Shape, ...]:
    """The shapes of all plugins that are seen where they stand."""
    return tuple(shape for record in records for shape in shapes_of(record))
