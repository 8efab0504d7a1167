"""Emitter `timed_sunsky`: the mean of the skies and suns of many days, while the shutter is open.

Light adds up, so that the mean of the pictures is that of the mean sky, which is one map.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.errors import SceneError
from clvol.scene import sunsky
from clvol.scene.lights import ConstantEmitter, Emitter, EnvmapEmitter, SunEmitter
from clvol.scene.sky_model import Sky, sun_irradiance
from clvol.scene.sun_position import Place, sun_direction
from clvol.scene.sunsky import FROM_MAP, HEIGHT, WIDTH, Air, map_directions

if TYPE_CHECKING:
    from datetime import date

    from clvol.scene.nodes import Node
    from clvol.scene.reader import Reader

MOMENTS = 1 << 16
"""At which the sun's place is looked up."""
DISK_POINTS = 16
"""That stand for its disk; the sun moves, and a texel is two thirds as wide as Earth's."""
ELEVATIONS = np.radians([0.0, 0.25, 0.5, *range(1, 91)])
"""Of the suns whose skies are added up; in between they are interpolated."""
HORIZON = HEIGHT // 2
"""Rows above it."""

log = logging.getLogger("clvol")


class Days(NamedTuple):
    """A window of hours on each of several days."""

    first: date
    number: int
    start: float
    end: float
    place: Place

    def suns(self, shares: np.ndarray) -> np.ndarray:
        """Unit vectors to the sun, float64 (n, 3), at shares of the whole from 0 to 1."""
        day = np.minimum(shares * self.number, np.nextafter(self.number, 0))
        whole = np.floor(day)
        hours = self.start + (self.end - self.start) * (day - whole)
        return sun_direction(self.first, 24 * whole + hours, self.place)


def timed_sunsky(reader: Reader) -> tuple[Emitter, ...]:
    """The `timed_sunsky` plugin, seen through the shutter of the scene's sensors."""
    air, days = sunsky.read_air(reader), _days(reader)
    opens, closes = _shares(reader)
    if opens == closes:
        log.warning(
            "%s: the sensor's shutter is open for no time, in which timed_sunsky shows one moment; "
            "a shutter_close of 1 shows all",
            reader.place(""),
        )
        day = sunsky.Daylight(air, None, days.suns(np.array([opens]))[0], "timed_sunsky")
        return tuple(map(_apart, sunsky.lights(reader, day)))
    shares = opens + (closes - opens) * (np.arange(MOMENTS) + 0.5) / MOMENTS
    suns = days.suns(shares)
    radiance = mean_sky(air, suns) + mean_sun(air, suns)
    if (radiance < 0).any():
        reader.library.faults.approximate(sunsky.LOW_SUN, reader.place(""))
    radiance = np.maximum(radiance, 0.0).astype(np.float32)
    if not radiance.any():
        return (ConstantEmitter((0.0,)),)
    try:
        checked = sunsky.checked(radiance, "timed_sunsky")
    except SceneError as error:
        reader.fail(error.what, hint=error.hint)
    return (EnvmapEmitter(checked, air.to_world @ FROM_MAP, "timed_sunsky"),)


def _apart(light: Emitter) -> Emitter:
    """A light that does not say what it was made from, which would be a `sunsky`."""
    if isinstance(light, ConstantEmitter | EnvmapEmitter | SunEmitter):
        return replace(light, made_from=None)
    return light


def _days(reader: Reader) -> Days:
    first = sunsky.read_date(reader, "start_", 2025, 1, 1)
    try:
        last = first.replace(year=first.year + 1)
    except ValueError:  # 29 February
        last = first.replace(year=first.year + 1, month=3, day=1)
    last = sunsky.read_date(reader, "end_", last.year, last.month, last.day)
    if last < first:
        reader.fail(f"the end, {last}, is before the start, {first}", "end_year")
    start, end = (
        reader.number(f"window_{name}_time", hour, 0.0, 24.0)
        for name, hour in (("start", 7.0), ("end", 19.0))
    )
    if end < start:
        reader.fail("window_end_time must not be before window_start_time", "window_end_time")
    return Days(first, max((last - first).days, 1), start, end, sunsky.read_place(reader))


def _shares(reader: Reader) -> tuple[float, float]:
    """The time that the sensors' shutter is open, as shares of the plugin's."""
    opens, closes = reader.number("shutter_open", 0.0), reader.number("shutter_close", 1.0)
    if not opens < closes:
        reader.fail("shutter_close must be after shutter_open", "shutter_close")
    times = {_shutter(node) for node in reader.library.sensors()} or {(0.0, 0.0)}
    if len(times) > 1:
        reader.unsupported("a timed_sunsky takes sensors of one shutter_open and shutter_close")
    first, last = ((time - opens) / (closes - opens) for time in times.pop())
    if not (0 <= first <= 1 and 0 <= last <= 1):
        reader.fail(
            "the sensor's shutter is open beyond the shutter_open and shutter_close of the timed_sunsky"
        )
    return first, last


def _shutter(sensor: Node) -> tuple[float, float]:
    """The times of a sensor's shutter; what is no number its own reader says."""
    opens, closes = (sensor.get(name, 0.0) for name in ("shutter_open", "shutter_close"))
    return (
        (float(opens), float(closes))
        if isinstance(opens, int | float) and isinstance(closes, int | float)
        else (0.0, 0.0)
    )


def mean_sky(air: Air, suns: np.ndarray) -> np.ndarray:
    """Mean radiance of the skies with suns in these directions, float64 (HEIGHT, WIDTH, 3).

    The sky of an elevation turns with its sun: the mean is a convolution along the rows of the map.
    """
    found = np.zeros((HEIGHT, WIDTH, 3))
    up = suns[suns[:, 2] >= 0]
    if air.sky_scale == 0 or not len(up):
        return found
    level = np.interp(np.arcsin(np.minimum(up[:, 2], 1.0)), ELEVATIONS, np.arange(len(ELEVATIONS)))
    weights = _splat(level, _column(up), (len(ELEVATIONS), WIDTH), np.full((len(up), 1), 1 / len(suns)))[
        ..., 0
    ]
    half = map_directions(np.arange(HORIZON), WIDTH, HEIGHT)[:, : WIDTH // 2 + 1]
    total = np.zeros((HORIZON, WIDTH // 2 + 1, 3), complex)
    azimuth = map_directions(np.array([(HEIGHT - 1) / 2]), WIDTH, HEIGHT)[0, 0]  # of column 0
    for elevation, row in zip(ELEVATIONS, weights, strict=True):
        if row.any():
            sun = np.array([*(np.cos(elevation) * azimuth[:2]), np.sin(elevation)])
            sky = Sky(air.turbidity, air.albedo, float(elevation)).radiance(half[..., 2], half @ sun)
            sky = np.concatenate([sky, sky[:, -2:0:-1]], axis=1)  # both sides of the sun are alike
            total += np.fft.rfft(sky, axis=1) * np.fft.rfft(row)[:, None]
    found[:HORIZON] = air.sky_scale * np.fft.irfft(total, WIDTH, axis=1)
    return found


def mean_sun(air: Air, suns: np.ndarray) -> np.ndarray:
    """Mean radiance of the disks of these suns, float64 (HEIGHT, WIDTH, 3), blue below 0 where it is so.

    Points of the disks go to the texels round them, so that the map keeps their energy.
    """
    found = np.zeros((HEIGHT, WIDTH, 3))
    up = suns[suns[:, 2] >= 0]
    if air.sun_scale == 0 or not len(up):
        return found
    irradiance = sun_irradiance(air.turbidity, np.arcsin(np.minimum(up[:, 2], 1.0)))
    irradiance *= air.sun_scale / (len(suns) * DISK_POINTS)
    for point in _disk(np.radians(air.aperture / 2)):
        place = _shifted(up, point)
        risen = place[:, 2] >= 0
        row = np.arccos(np.clip(place[risen, 2], -1, 1)) * (HEIGHT - 1) / np.pi
        column = _column(place[risen])
        found += _splat(row, column, (HEIGHT, WIDTH), irradiance[risen])
    found[HORIZON - 1] += found[HORIZON]  # nothing shines from below
    found[HORIZON] = 0
    found /= _solid_angles()[:, None, None]
    return found


def _disk(radius: float) -> np.ndarray:
    """Points evenly over a disk on the sphere: (n, 3), about z."""
    n = np.arange(DISK_POINTS) + 0.5
    cosine = 1 - n / DISK_POINTS * (1 - np.cos(radius))
    sine, turn = np.sqrt(1 - cosine**2), n * np.pi * (3 - np.sqrt(5))
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1)


def _shifted(suns: np.ndarray, point: np.ndarray) -> np.ndarray:
    """A point about z as it is about each of the suns, (n, 3)."""
    side = np.stack([-suns[:, 1], suns[:, 0], np.zeros(len(suns))], axis=-1)
    length = np.linalg.norm(side, axis=1, keepdims=True)
    side = np.where(length > 0, side / np.maximum(length, 1e-300), (1.0, 0.0, 0.0))
    x, y, z = point
    moved: np.ndarray = x * side + y * np.cross(suns, side) + z * suns
    return moved


def _column(directions: np.ndarray) -> np.ndarray:
    """Columns of the map, in texels, that directions in the sky are in, from 0 to WIDTH."""
    local = directions @ FROM_MAP[:3, :3]
    turn = np.arctan2(local[:, 0], -local[:, 2]) / (2 * np.pi)
    column: np.ndarray = (turn * WIDTH - 0.5) % WIDTH
    return column


def _splat(row: np.ndarray, column: np.ndarray, shape: tuple[int, int], weights: np.ndarray) -> np.ndarray:
    """Weights (n, channels) shared out to the four cells round their places; columns go round."""
    y, x = np.minimum(row.astype(int), shape[0] - 2), column.astype(int)
    fy, fx = row - y, column - x
    total = np.zeros((shape[0] * shape[1], weights.shape[1]))
    for dy, share in ((0, 1 - fy), (1, fy)):
        for dx, part in ((0, 1 - fx), (1, fx)):
            cell = (y + dy) * shape[1] + (x + dx) % shape[1]
            for channel, weight in enumerate(weights.T):
                total[:, channel] += np.bincount(cell, share * part * weight, len(total))
    shared: np.ndarray = total.reshape(*shape, -1)
    return shared


def _solid_angles() -> np.ndarray:
    """Integral of a texel's share of the map between texels, by its row, float64 (HEIGHT,)."""
    step = np.pi / (HEIGHT - 1)
    polar = np.arange(HEIGHT) * step
    around = np.sin(polar) * 2 * (1 - np.cos(step)) / step
    around[[0, -1]] = (step - np.sin(step)) / step
    solid: np.ndarray = 2 * np.pi / WIDTH * around
    return solid
