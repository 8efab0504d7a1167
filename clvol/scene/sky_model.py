"""The sky and the sun of Hosek and Wilkie, in linear sRGB and with Mitsuba's units.

Hosek and Wilkie 2012, An Analytic Model for Full Spectral Sky-Dome Radiance, equations 8 and 11; and 2013,
Adding a Solar Radiance Function to the Hosek Skylight Model.  Their coefficients, and the licence of these,
are in `data/`.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from math import comb

import numpy as np

TURBIDITIES = 1.0, 10.0
LOWEST_SUN, SUN_STEP = np.radians(2.0), np.radians(3.0)
"""Elevations of the table of the sun: the lowest, and their distance."""


@cache
def tables() -> dict[str, np.ndarray]:
    """The model's coefficients, float64, each with turbidities 1 to 10 along its first axis.

    sky_shape : (10, 2, 6, 3, 9): albedos 0 and 1, control points of the sun's elevation, channels.
    sky_scale : (10, 2, 6, 3).  sun_irradiance : (10, 30, 3), normal to the sun, by its elevation.
    """
    with (
        (resources.files("clvol.scene") / "data" / "hosek_wilkie.npz").open("rb") as file,
        np.load(file) as data,
    ):
        return {name: data[name].astype(np.float64) for name in data.files}


class Sky:
    """The clear sky with the sun at an elevation.

    Parameters
    ----------
    turbidity : from 1 to 10.
    albedo : of the ground, from 0 to 1, float64 (3,).
    elevation : of the sun, radians, from 0 to π/2.
    """

    def __init__(self, turbidity: float, albedo: np.ndarray, elevation: float) -> None:
        x = np.cbrt(2 * elevation / np.pi)
        bernstein = np.array([comb(5, k) * x**k * (1 - x) ** (5 - k) for k in range(6)])
        shape, scale = (_at_turbidity(tables()[name], turbidity) for name in ("sky_shape", "sky_scale"))
        shape, scale = np.tensordot(bernstein, shape, (0, 1)), np.tensordot(bernstein, scale, (0, 1))
        self.shape = shape[0] + albedo[:, None] * (shape[1] - shape[0])
        self.scale = scale[0] + albedo * (scale[1] - scale[0])

    def radiance(self, up: np.ndarray, to_sun: np.ndarray) -> np.ndarray:
        """Radiance, float64 (..., 3), where cosines to the zenith (>= 0) and to the sun are so."""
        angle = np.arccos(np.clip(to_sun, -1, 1))
        squared, root = to_sun * to_sun, np.sqrt(up)
        found = np.empty((*np.broadcast_shapes(np.shape(up), np.shape(to_sun)), 3))
        for channel, (a, b, c, d, e, f, g, h, i) in enumerate(self.shape):
            glow = (1 + squared) / (1 + i * i - 2 * i * to_sun) ** 1.5
            bright = c + d * np.exp(e * angle) + f * squared + g * glow + h * root
            found[..., channel] = (1 + a * np.exp(b / (up + 0.01))) * bright * self.scale[channel]
        return np.maximum(found, 0.0)


def sun_irradiance(turbidity: float, elevation: np.ndarray | float) -> np.ndarray:
    """Irradiance normal to the sun, float64 (..., 3), with the sun at `elevation` in radians.

    Blue is negative where a low sun is redder than sRGB's red.  Mitsuba's table ends at 2° and at 89°.
    """
    table = _at_turbidity(tables()["sun_irradiance"], turbidity)
    at = (np.asarray(elevation) - LOWEST_SUN) / SUN_STEP
    return np.stack([np.interp(at, np.arange(len(table)), channel) for channel in table.T], axis=-1)


def _at_turbidity(table: np.ndarray, turbidity: float) -> np.ndarray:
    below = min(int(turbidity) - 1, len(table) - 2)
    found: np.ndarray = table[below] + (turbidity - 1 - below) * (table[below + 1] - table[below])
    return found
