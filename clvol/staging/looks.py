"""Lights by name, as data: a dome that changes with the elevation alone, and lamps at infinity."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Lamp:
    """Parallel light from infinity, by degrees from the camera: `azimuth` to its right, `elevation` above."""

    azimuth: float
    elevation: float
    irradiance: Colour


@dataclass(frozen=True)
class Dome:
    """An environment that changes with the elevation alone: radiances at degrees, linear between them."""

    degrees: tuple[float, ...]
    radiances: tuple[Colour, ...]


@dataclass(frozen=True)
class Look:
    """What one name of --light stands for."""

    summary: str
    dome: Dome
    lamps: tuple[Lamp, ...] = ()


LOOKS = {
    "sun": Look(
        "a sun behind the camera's left shoulder, and a blue sky",
        Dome(
            (-90, -40, -10, 8, 35, 90),
            (
                (0.14, 0.2, 0.28),
                (0.21, 0.32, 0.5),
                (0.42, 0.57, 0.78),
                (0.5, 0.66, 0.87),
                (0.24, 0.39, 0.7),
                (0.14, 0.28, 0.59),
            ),
        ),
        (Lamp(-75, 38, (12, 11, 8.8)),),
    ),
    "sky": Look(
        "a bright sky without a sun: soft light from above",
        Dome(
            (-90, -40, -5, 25, 90),
            (
                (0.22, 0.23, 0.27),
                (0.36, 0.4, 0.45),
                (0.76, 0.83, 0.94),
                (1.7, 1.9, 2.2),
                (4, 4.3, 4.9),
            ),
        ),
    ),
    "studio": Look(
        "a warm key light, a cool fill and a light from behind, before a grey wall",
        Dome(
            (-90, -45, -8, 8, 45, 90),
            (
                (0.045, 0.045, 0.045),
                (0.06, 0.06, 0.063),
                (0.24, 0.24, 0.25),
                (0.24, 0.24, 0.25),
                (0.075, 0.075, 0.078),
                (0.38, 0.38, 0.39),
            ),
        ),
        (
            Lamp(-50, 40, (11, 10, 8.5)),
            Lamp(70, 10, (1.4, 1.7, 2.4)),
            Lamp(165, 30, (6, 6.3, 7.1)),
        ),
    ),
    "rim": Look(
        "two lights from behind before a dark wall",
        Dome(
            (-90, -40, 0, 40, 90),
            (
                (0.004, 0.004, 0.005),
                (0.006, 0.006, 0.008),
                (0.022, 0.024, 0.03),
                (0.006, 0.006, 0.008),
                (0.03, 0.03, 0.035),
            ),
        ),
        (Lamp(140, 30, (16, 15, 12)), Lamp(-130, 12, (5.2, 6.9, 10))),
    ),
}
"""--light: name and what it is."""
