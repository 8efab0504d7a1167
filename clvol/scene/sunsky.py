"""Emitter `sunsky`: a sky as an environment map, and the sun as a light of its own.

Locally z is up.  As in Mitsuba, nothing shines from below the horizon, nor while the sun's middle is there.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.rows import bands
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


@dataclass(frozen=True, eq=False)
class Air:
    """What the plugins share.  albedo : of the ground, float64 (3,).  aperture : of the sun, degrees."""

    turbidity: float
    albedo: np.ndarray
    sky_scale: float
    sun_scale: float
    aperture: float
    to_world: np.ndarray


def sunsky(reader: Reader) -> tuple[Emitter, ...]:
    """The `sunsky` plugin: the sky and the sun at a time and place, or with the sun in a direction."""
    air = read_air(reader)
    return lights(reader, air, _sun(reader, air))


def lights(reader: Reader, air: Air, local: np.ndarray) -> tuple[Emitter, ...]:
    """The sky and the sun, with the sun in a direction of local space."""
    irradiance = np.zeros(3)
    if local[2] < 0:
        reader.library.faults.approximate("a sky whose sun is below the horizon is black", reader.place(""))
    elif air.sun_scale > 0:
        irradiance = air.sun_scale * _visible(reader, sun_irradiance(air.turbidity, np.arcsin(local[2])))
    sky: Emitter = ConstantEmitter((0.0,))
    if air.sky_scale > 0 and local[2] >= 0:
        sky = EnvmapEmitter(checked(reader, _sky_map(air, local)), air.to_world @ FROM_MAP, reader.type)
    if not irradiance.any():
        return (sky,)
    turn = air.to_world[:3, :3] / np.cbrt(np.abs(np.linalg.det(air.to_world[:3, :3])))
    half = np.radians(air.aperture / 2)
    sun = SunEmitter(
        tuple(checked(reader, irradiance).tolist()),
        tuple((turn @ local).tolist()),
        air.aperture,
        tuple(turn[:, 2].tolist()) if np.arcsin(local[2]) < half else None,
    )
    return sky, sun


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


def _sun(reader: Reader, air: Air) -> np.ndarray:
    """The unit vector to the sun in local space."""
    if not reader.has("sun_direction"):
        day = read_date(reader, "", 2010, 7, 10)
        hour, minute, second = (
            reader.number(name, n) for name, n in (("hour", 15.0), ("minute", 0.0), ("second", 0.0))
        )
        hours = np.array(hour + (minute + second / 60) / 60)
        if abs(hours) > 1e6:
            reader.fail("the hour is too far from the day", "hour")
        return sun_direction(day, hours, read_place(reader))
    given = [name for name in (*TIME, *PLACE) if reader.has(name)]
    if given:
        reader.fail(f"give either sun_direction or {given[0]}, not both", given[0])
    direction = reader.vector("sun_direction", (0, 0, 1))
    if not direction.any():
        reader.fail("sun_direction is zero", "sun_direction")
    return unit(np.linalg.inv(air.to_world[:3, :3]) @ unit(direction))


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


def _visible(reader: Reader, irradiance: np.ndarray) -> np.ndarray:
    """A colour without what a low sun lacks of blue."""
    if (irradiance < 0).any():
        say_blue(reader)
    visible: np.ndarray = np.maximum(irradiance, 0.0)
    return visible


def say_blue(reader: Reader) -> None:
    """Say that blue is cut."""
    what = "the blue of a low sun, which sRGB has below 0, is 0"
    reader.library.faults.approximate(what, reader.place(""))


def checked(reader: Reader, light: np.ndarray) -> np.ndarray:
    """Light that is not too bright."""
    if light.max() > BRIGHTEST:
        reader.fail(f"a {reader.type} must not exceed {BRIGHTEST:g}", "", "lower sky_scale or sun_scale")
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
