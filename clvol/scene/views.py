"""A scene seen otherwise: by another of its sensors, in another size, or before another background."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

from clvol.errors import OptionError, shown
from clvol.scene.loader import load_sensor
from clvol.scene.parameters import sensor_with
from clvol.scene.records import Sampler, Sensor
from clvol.scene.sensor import film_fault

View = int | Mapping[str, Any]
"""A sensor: the number of one that the scene has, or a dict."""

TRANSPARENT = "transparent"
"""The background of a picture with alpha."""

if TYPE_CHECKING:
    from clvol.scene.records import Scene, Spectrum


def viewed(
    scene: Scene,
    sensor: View | None = None,
    size: tuple[int, int] | None = None,
    background: str = "auto",
) -> Scene:
    """The scene `seen_by` a sensor, `in_size`, and `before` a transparent background, where asked for."""
    scene = scene if sensor is None else seen_by(scene, sensor)
    scene = scene if size is None else in_size(scene, size)
    transparent = isinstance(background, str) and background == TRANSPARENT
    return before(scene, background) if transparent else scene


def seen_by(scene: Scene, sensor: View) -> Scene:
    """The scene as a sensor sees it, with that sensor's film, samples and seed.

    sensor : the number of one of its own, from 0; or a dict.  One with a "type" is a sensor as `load_dict`
        takes it; without a film and a sampler of its own it has the scene's.  One without changes the scene's
        sensor, by the names of `clvol.traverse`: ``{"to_world": …}``.

    Raises OptionError for a number that none has, and SceneError for a dict that is no sensor.
    """
    if isinstance(sensor, Mapping):
        view = _described(scene, sensor)
        return replace(
            scene, sensor=view.camera, film=view.film, spp=view.sampler.spp, seed=view.sampler.seed
        )
    count = len(scene.sensors)
    try:
        number = operator.index(sensor)
    except TypeError:
        hint = "give the number of one of the scene's sensors, or a dict"
        raise OptionError(f"sensor must be a number or a dict, not {shown(sensor)}", hint=hint) from None
    if not 0 <= number < count:
        have = "one sensor, number 0" if count == 1 else f"{count} sensors, numbered from 0"
        raise OptionError(f"there is no sensor {number}: the scene has {have}", scene.source)
    view = scene.sensors[number]
    return replace(scene, sensor=view.camera, film=view.film, spp=view.sampler.spp, seed=view.sampler.seed)


def _described(scene: Scene, given: Mapping[str, Any]) -> Sensor:
    now = Sensor(scene.sensor, scene.film, Sampler(scene.spp, scene.seed))
    if "type" not in given:
        return sensor_with(now, given)
    found, own = load_sensor(given)
    return replace(
        found,
        film=found.film if "film" in own else now.film,
        sampler=found.sampler if "sampler" in own else now.sampler,
    )


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
