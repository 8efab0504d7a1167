"""Emitter `sunsky`: a sky as an environment map, and the sun as a light of its own.

Locally z is up.  As in Mitsuba, nothing shines from below the horizon, nor while the sun's middle is there.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.rows import bands
from clvol.errors import SceneError
from clvol.scene.emitter import accept_common
from clvol.scene.lights import ConstantEmitter, Emitter, EnvmapEmitter, SunEmitter
from clvol.scene.reader import BRIGHTEST
from clvol.scene.sky_model import TURBIDITIES, Sky, sun_irradiance
from clvol.scene.sun_position import Place, sun_direction
from clvol.scene.transforms import keeps_angles

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

WIDTH, HEIGHT = 1024, 512
"""Of the sky's map.  Between texels it is within 1 % of the model, and within 1e-5 in its irradiance, but for
the row at the horizon, through which it fades out."""
APERTURE = 0.5358
APERTURES = 1e-4, 179.9
"""Of the sun, in degrees: Earth's, and those that directions of single precision have room for."""
TIME = ("year", "month", "day", "hour", "minute", "second")
PLACE = ("latitude", "longitude", "timezone")
FROM_MAP = np.array(
    [[0.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""From a map's axes, of which y is up, to those of the sky."""

LOW_SUN = "the blue of a low sun, which sRGB has below 0, is 0"

log = logging.getLogger("clvol")


@dataclass(frozen=True, eq=False)
class Air:
    """What the plugins share.  albedo : of the ground, float64 (3,).  aperture : of the sun, degrees."""

    turbidity: float
    albedo: np.ndarray
    sky_scale: float
    sun_scale: float
    aperture: float
    to_world: np.ndarray


@dataclass(frozen=True, eq=False)
class Daylight:
    """What the lights of a `sunsky` are made from.

    towards : unit vector to the sun in the world, where that is given.  local : that in the sky's own space,
    where `towards` is None.  source : the plugin's name.
    """

    air: Air
    towards: tuple[float, float, float] | None
    local: np.ndarray
    source: str

    @property
    def sun(self) -> np.ndarray:
        """Unit vector to the sun in the sky's own space."""
        if self.towards is None:
            return self.local
        return unit(np.linalg.inv(self.air.to_world[:3, :3]) @ np.array(self.towards))

    @property
    def turn(self) -> np.ndarray:
        """From the sky's own space to the world, without its scale."""
        matrix = self.air.to_world[:3, :3]
        turned: np.ndarray = matrix / np.cbrt(np.abs(np.linalg.det(matrix)))
        return turned


def sunsky(reader: Reader) -> tuple[Emitter, ...]:
    """The `sunsky` plugin: the sky and the sun at a time and place, or with the sun in a direction."""
    return lights(reader, _daylight(reader, read_air(reader)))


def lights(reader: Reader, day: Daylight) -> tuple[Emitter, ...]:
    """The sky and the sun."""
    try:
        made, said = lights_of(day)
    except SceneError as error:
        reader.fail(error.what, hint=error.hint)
    for what in said:
        reader.library.faults.approximate(what, reader.place(""))
    return made


def lights_of(day: Daylight) -> tuple[tuple[Emitter, ...], list[str]]:
    """The sky and the sun, and what is taken as something else; SceneError where they are too bright."""
    air, local, said = day.air, day.sun, list[str]()
    irradiance = np.zeros(3)
    if local[2] < 0:
        said.append("a sky whose sun is below the horizon is black")
    elif air.sun_scale > 0:
        irradiance = air.sun_scale * sun_irradiance(air.turbidity, np.arcsin(local[2]))
        said += [LOW_SUN] if (irradiance < 0).any() else []
        irradiance = np.maximum(irradiance, 0.0)
    sky: Emitter = ConstantEmitter((0.0,), made_from=day)
    if air.sky_scale > 0 and local[2] >= 0:
        radiance = checked(_sky_map(air, local), day.source)
        sky = EnvmapEmitter(radiance, air.to_world @ FROM_MAP, day.source, made_from=day)
    if not irradiance.any():
        return (sky,), said
    half = np.radians(air.aperture / 2)
    sun = SunEmitter(
        tuple(checked(irradiance, day.source).tolist()),
        tuple((day.turn @ local).tolist()),
        air.aperture,
        tuple(day.turn[:, 2].tolist()) if np.arcsin(local[2]) < half else None,
        made_from=day,
    )
    return (sky, sun), said


def remade(emitters: tuple[Emitter, ...], before: tuple[Emitter, ...]) -> tuple[Emitter, ...]:
    """Emitters with those made anew whose `Daylight` is none of those `before`; errors as `lights_of` has."""
    known = {id(getattr(emitter, "made_from", None)) for emitter in before} | {id(None)}
    made: list[Emitter] = []
    done: set[int] = set()
    for emitter in emitters:
        day: Any = getattr(emitter, "made_from", None)
        if id(day) in known:
            made.append(emitter)
        elif id(day) not in done:
            done.add(id(day))
            new, said = lights_of(day)
            made += [replace(one, name=emitter.name) for one in new]
            for what in said:
                log.warning("%s", what)
    return tuple(made)


def read_air(reader: Reader) -> Air:
    """Everything but where the sun stands."""
    accept_common(reader)
    turbidity = reader.number("turbidity", 3.0, *TURBIDITIES)
    if not reader.is_value("albedo"):
        reader.refuse_plugin("albedo", "a number, an rgb or a spectrum")
    albedo = np.broadcast_to(reader.color("albedo", 0.3, maximum=1.0), 3).astype(np.float64)
    sky_scale, sun_scale = (reader.number(name, 1.0, minimum=0.0) for name in ("sky_scale", "sun_scale"))
    aperture = reader.number("sun_aperture", APERTURE, *APERTURES)
    if reader.boolean("complex_sun", False):
        reader.approximated("false: the sun's disk is even, of the same irradiance", "complex_sun")
    to_world = reader.transform()
    if not keeps_angles(to_world):
        reader.fail(f"to_world of a {reader.type} must not stretch or shear it", "to_world", "rotate it only")
    return Air(turbidity, albedo, sky_scale, sun_scale, aperture, to_world)


def _daylight(reader: Reader, air: Air) -> Daylight:
    """With the sun at a time and place, or in a direction."""
    if not reader.has("sun_direction"):
        day = read_date(reader, "", 2010, 7, 10)
        hour, minute, second = (
            reader.number(name, n) for name, n in (("hour", 15.0), ("minute", 0.0), ("second", 0.0))
        )
        hours = np.array(hour + (minute + second / 60) / 60)
        if abs(hours) > 1e6:
            reader.fail("the hour is too far from the day", "hour")
        return Daylight(air, None, sun_direction(day, hours, read_place(reader)), reader.type)
    given = [name for name in (*TIME, *PLACE) if reader.has(name)]
    if given:
        reader.fail(f"give either sun_direction or {given[0]}, not both", given[0])
    direction = reader.vector("sun_direction", (0, 0, 1))
    if not direction.any():
        reader.fail("sun_direction is zero", "sun_direction")
    x, y, z = unit(direction).tolist()
    return Daylight(air, (x, y, z), np.array((0.0, 0.0, 1.0)), reader.type)


def unit(vector: np.ndarray) -> np.ndarray:
    """The vector of length 1, whatever its own."""
    scaled = vector / np.abs(vector).max()
    direction: np.ndarray = scaled / np.linalg.norm(scaled)
    return direction


def read_place(reader: Reader) -> Place:
    """Latitude, longitude and time zone."""
    return Place(
        reader.number("latitude", Place.latitude, -90.0, 90.0),
        reader.number("longitude", Place.longitude, -360.0, 360.0),
        reader.number("timezone", Place.timezone, -24.0, 24.0),
    )


def read_date(reader: Reader, prefix: str, year: int, month: int, day: int) -> date:
    """The date in parameters of these names, with these defaults."""
    year = reader.integer(f"{prefix}year", year, 1, 9998)
    month = reader.integer(f"{prefix}month", month, 1, 12)
    day = reader.integer(f"{prefix}day", day, 1, 31)
    try:
        return date(year, month, day)
    except ValueError as error:
        reader.fail(f"there is no {year}-{month}-{day} ({error})", f"{prefix}day")


def checked(light: np.ndarray, source: str) -> np.ndarray:
    """Light that is not too bright."""
    if light.max() > BRIGHTEST:
        raise SceneError(f"a {source} must not exceed {BRIGHTEST:g}", hint="lower sky_scale or sun_scale")
    return light


def _sky_map(air: Air, sun: np.ndarray) -> np.ndarray:
    """Radiance of the sky as a map, float32 (HEIGHT, WIDTH, 3), its upper half where there is any."""
    sky = Sky(air.turbidity, air.albedo, float(np.arcsin(sun[2])))
    radiance = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for rows in bands(HEIGHT // 2, WIDTH):
        towards = map_directions(np.arange(rows.start, rows.stop), WIDTH, HEIGHT)
        radiance[rows] = air.sky_scale * sky.radiance(towards[..., 2], towards @ sun)
    return radiance


def map_directions(rows: np.ndarray, width: int, height: int) -> np.ndarray:
    """Where texels of a map look in the sky's local space, float64 (rows, width, 3)."""
    polar = rows[:, None] * np.pi / (height - 1)
    turn = (np.arange(width) + 0.5) * 2 * np.pi / width
    across = [np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)]
    towards: np.ndarray = np.stack(np.broadcast_arrays(*across), axis=-1) @ FROM_MAP[:3, :3].T
    return towards
