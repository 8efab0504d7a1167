"""What a scene is to the integrator `depth`: surfaces alone, whose distance is the picture.

As in Mitsuba every shape is met, whatever its BSDF lets through, and there are neither media nor lights.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from clvol.scene.materials import Diffuse, Null
from clvol.scene.records import Batch, IrradianceMeter, Meter, Shape

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.scene.records import Camera, Scene


def bare(scene: Scene) -> Scene:
    """The scene without media and lights, each of whose shapes ends every ray."""
    shapes = {id(shape): _bare_shape(shape) for shape in scene.shapes}
    sensors = tuple(replace(one, camera=bare_camera(one.camera, shapes)) for one in scene.sensors)
    return replace(
        scene,
        sensor=bare_camera(scene.sensor, shapes),
        sensors=sensors,
        shapes=tuple(shapes.values()),
        emitters=(),
    )


def _bare_shape(shape: Shape) -> Shape:
    bsdf = Diffuse() if isinstance(shape.bsdf, Null) else shape.bsdf
    return replace(shape, interior=None, exterior=None, emission=None, bsdf=bsdf)


def bare_camera(camera: Camera | Batch, shapes: Mapping[int, Shape]) -> Camera | Batch:
    """A camera that is in no medium; `shapes`: what has become of those that it may be on, by id()."""
    if isinstance(camera, Batch):
        return replace(camera, parts=tuple(_bare_part(part, shapes) for part in camera.parts))
    return _bare_part(camera, shapes)


def _bare_part(camera: Camera, shapes: Mapping[int, Shape]) -> Camera:
    if isinstance(camera, IrradianceMeter):
        return replace(camera, medium=None, shape=shapes.get(id(camera.shape), camera.shape))
    if isinstance(camera, Meter) and isinstance(camera.target, Shape):
        return replace(camera, medium=None, target=shapes.get(id(camera.target), camera.target))
    return replace(camera, medium=None)
