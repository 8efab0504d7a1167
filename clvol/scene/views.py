"""A scene seen otherwise: by another of its sensors, in another size, or before another background."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

from clvol.base.arguments import index
from clvol.errors import OptionError, SceneError, shown
from clvol.scene.depth_picture import bare_camera
from clvol.scene.loader import load_sensor
from clvol.scene.parameters import sensor_with
from clvol.scene.records import Batch, IrradianceMeter, Meter, Sampler, Sensor
from clvol.scene.sensor import BOX, batch_fault, film_fault

View = int | Mapping[str, Any]
"""A sensor: the number of one that the scene has, or a dict."""

TRANSPARENT = "transparent"
"""The background of a picture with alpha."""

if TYPE_CHECKING:
    from clvol.scene.records import Camera, Film, Scene, Spectrum


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

    sensor : the number of one of its own, from 0, as `all_sensors` has them; or a dict.  One with a "type" is
        a sensor as `load_dict` takes it; without a film and a sampler of its own it has the scene's.  One
        without changes the scene's sensor, by the names of `clvol.traverse`: ``{"to_world": …}``.

    Raises OptionError for a number that none has, and SceneError for a dict that is no sensor.
    """
    if isinstance(sensor, Mapping):
        view = _described(scene, sensor)
        camera = bare_camera(view.camera, {}) if scene.integrator.shows_depth else view.camera
        return replace(scene, sensor=camera, film=view.film, spp=view.sampler.spp, seed=view.sampler.seed)
    sensors = all_sensors(scene)
    try:
        number = index(sensor)
    except TypeError:
        hint = "give the number of one of the scene's sensors, or a dict"
        raise OptionError(f"sensor must be a number or a dict, not {shown(sensor)}", hint=hint) from None
    if not 0 <= number < len(sensors):
        have = "one sensor, number 0" if len(sensors) == 1 else f"{len(sensors)} sensors, numbered from 0"
        raise OptionError(f"there is no sensor {number}: the scene has {have}", scene.source)
    view = sensors[number]
    return replace(scene, sensor=view.camera, film=view.film, spp=view.sampler.spp, seed=view.sampler.seed)


def all_sensors(scene: Scene) -> list[Sensor]:
    """The sensors of a scene in its order, and after them those inside of a batch, each with its part."""
    inside = []
    for sensor in scene.sensors:
        if isinstance(sensor.camera, Batch):
            for camera, name in zip(sensor.camera.parts, sensor.camera.names, strict=True):
                film = _film_of_part(sensor.film, sensor.camera, camera)
                inside.append(Sensor(camera, film, sensor.sampler, f"{sensor.name}.{name}"))
    return [*scene.sensors, *inside]


def _film_of_part(film: Film, batch: Batch, camera: Camera) -> Film:
    """What one of several cameras has of a film; SceneError where it cannot be shared evenly."""
    if fault := batch_fault(film, len(batch.parts)):
        raise SceneError(fault)
    part = replace(film, width=film.width // len(batch.parts))
    return replace(part, rfilter=BOX) if isinstance(camera, Meter | IrradianceMeter) else part


def parts_of(scene: Scene) -> list[Scene]:
    """The pictures that the scene's stands of, from the left: one, or those of a batch.

    Filters reach over no seam: each picture ends there as at the edge of a film.
    """
    if not isinstance(scene.sensor, Batch):
        return [scene]
    batch = scene.sensor
    films = [_film_of_part(scene.film, batch, camera) for camera in batch.parts]
    return [replace(scene, sensor=one, film=film) for one, film in zip(batch.parts, films, strict=True)]


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
    film = replace(scene.film, width=width, height=height)
    if isinstance(scene.sensor, Batch) and (fault := batch_fault(film, len(scene.sensor.parts))):
        raise OptionError(fault, scene.source)
    return replace(scene, film=film)


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
        width, height = map(index, size)
    except (TypeError, ValueError):
        raise OptionError(
            f"size must be two whole numbers, not {shown(size)}", hint="as (640, 480)"
        ) from None
    if fault := film_fault(width, height):
        raise OptionError(fault)
    return width, height
