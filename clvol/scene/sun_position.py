"""Where the sun stands, by date, time and place.

Blanco-Muriel, Alarcón-Padilla, López-Moratalla, Lara-Coira 2001, Computing the Solar Vector, appendix B.
Directions are Mitsuba's: z is up, x south and y west.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date

import numpy as np

NEW_YEAR_2000 = date(2000, 1, 1)
EARTH_RADIUS, ASTRONOMICAL_UNIT = 6371.01, 149597890.0
"""In kilometres."""


@dataclass(frozen=True)
class Place:
    """A place on Earth in degrees, and the hours by which its clocks are ahead of Universal Time."""

    latitude: float = 35.6894
    longitude: float = 139.6917
    timezone: float = 9.0


def sun_direction(day: date, hours: np.ndarray, place: Place) -> np.ndarray:
    """Unit vectors towards the sun, float64 (..., 3), at `hours` of local time, of later days too."""
    universal = np.asarray(hours, np.float64) - place.timezone
    days = (day - NEW_YEAR_2000).days - 0.5 + universal / 24
    ascension, declination = _equatorial(days)
    sidereal = 6.6974243242 + 0.0657098283 * days + universal
    hour_angle = np.radians(15 * sidereal + place.longitude) - ascension
    latitude = np.radians(place.latitude)
    up = np.cos(latitude) * np.cos(declination) * np.cos(hour_angle) + np.sin(latitude) * np.sin(declination)
    zenith = np.arccos(np.clip(up, -1, 1))
    zenith = zenith + EARTH_RADIUS / ASTRONOMICAL_UNIT * np.sin(zenith)  # as seen from the ground
    azimuth = np.arctan2(
        -np.sin(hour_angle),
        np.tan(declination) * np.cos(latitude) - np.sin(latitude) * np.cos(hour_angle),
    )
    sine = np.sin(zenith)
    return np.stack([-np.cos(azimuth) * sine, -np.sin(azimuth) * sine, np.cos(zenith)], axis=-1)


def _equatorial(days: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Right ascension and declination, radians, at days since noon of 1 January 2000."""
    node = 2.1429 - 0.0010394594 * days
    mean, anomaly = 4.8950630 + 0.017202791698 * days, 6.2400600 + 0.0172019699 * days
    longitude = mean + 0.03341607 * np.sin(anomaly) + 0.00034894 * np.sin(2 * anomaly)
    longitude = longitude - 0.0001134 - 0.0000203 * np.sin(node)
    obliquity = 0.4090928 - 6.2140e-9 * days + 0.0000396 * np.cos(node)
    ascension = np.arctan2(np.cos(obliquity) * np.sin(longitude), np.cos(longitude))
    return ascension, np.arcsin(np.sin(obliquity) * np.sin(longitude))
