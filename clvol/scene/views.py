"""A scene seen otherwise: by another of its sensors, in another size, or before another background."""

from __future__ import annotations

import operator
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from clvol.errors import OptionError, shown
from clvol.scene.sensor import film_fault

TRANSPARENT = "transparent"
"""The background of a picture with alpha."""

if TYPE_CHECKING:
    from clvol.scene.records import Scene, Spectrum


def viewed(
    scene: Scene,
    sensor: int | None = None,
    size: tuple[int, int] | None = None,
    background: str = "auto",
) -> Scene:
    """The scene `seen_by` a sensor, `in_size`, and `before` a transparent background, where asked for."""
    scene = scene if sensor is None else seen_by(scene, sensor)
    scene = scene if size is None else in_size(scene, size)
    return before(scene, background) if background == TRANSPARENT else scene


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


def before(scene: Scene, background: str | Spectrum) -> Scene:
    """The scene before a background of its own, which lights nothing, instead of the environment.

    background : linear radiance, one number or three; or "transparent", of a picture with alpha.  The
        environment still lights the scene.
    """
    if background == TRANSPARENT:
        return replace(scene, film=replace(scene.film, pixel_format="rgba", backdrop=(0.0,)))
    return replace(scene, film=replace(scene.film, backdrop=cast("Spectrum", background)))


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
