"""A scene seen otherwise: by another of its sensors, or in another size."""

from __future__ import annotations

import operator
from dataclasses import replace
from typing import TYPE_CHECKING

from clvol.errors import OptionError, shown
from clvol.scene.sensor import film_fault

TRANSPARENT = "transparent"

if TYPE_CHECKING:
    from clvol.scene.records import Scene


def viewed(scene: Scene, sensor: int | None = None, size: tuple[int, int] | None = None) -> Scene:
    """The scene `seen_by` a sensor and `in_size`, where these are given."""
    scene = scene if sensor is None else seen_by(scene, sensor)
    return scene if size is None else in_size(scene, size)


def seen_by(scene: Scene, sensor: int) -> Scene:
    """The scene as its sensor of that number sees it, from 0, with that sensor's film, samples and seed.

    Raises OptionError for a number that none has.
    """
    count = len(scene.sensors)
    try:
        number = operator.index(sensor)
    except TypeError:
        raise OptionError(f"sensor must be a number, not {shown(sensor)}") from None
    if not 0 <= number < count:
        have = "one sensor, number 0" if count == 1 else f"{count} sensors, numbered from 0"
        raise OptionError(f"there is no sensor {number}: the scene has {have}", scene.source)
    view = scene.sensors[number]
    return replace(scene, sensor=view.camera, film=view.film, spp=view.sampler.spp, seed=view.sampler.seed)


def in_size(scene: Scene, size: tuple[int, int]) -> Scene:
    """The scene on a film of (width, height) pixels.

    Its field of view stays along the axis that it is given for.  Raises OptionError for impossible sizes, and
    for films with a crop window, whose pixels are of the old size.
    """
    width, height = check_size(size)
    if scene.film.crop is not None:
        hint = "leave the size out, or the crop window in the scene"
        raise OptionError("the film has a crop window, which goes with its own size", scene.source, hint)
    return replace(scene, film=replace(scene.film, width=width, height=height))


def before(scene: Scene, background: str | tuple[float, ...]) -> Scene:
    """The scene before a background of its own, which lights nothing, instead of the lights behind it.

    background : linear radiance, one number or three; or "transparent", of a picture with alpha.
    """
    integrator = replace(scene.integrator, hide_emitters=True)
    if background == TRANSPARENT:
        return replace(scene, film=replace(scene.film, pixel_format="rgba"), integrator=integrator)
    return replace(scene, integrator=integrator)


def check_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a film; OptionError where there can be none of that size."""
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError):
        raise OptionError(
            f"size must be two whole numbers, not {shown(size)}", hint="as (640, 480)"
        ) from None
    if fault := film_fault(width, height):
        raise OptionError(fault)
    return width, height
