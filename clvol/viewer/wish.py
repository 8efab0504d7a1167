"""What somebody at the page wants to see: how knobs are turned, and how the picture is shown."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

from clvol.errors import OptionError, shown
from clvol.planning.registry import check_choice

_VIEW = 9
"""Numbers of a camera: origin, target, up."""
_LIMITS = {
    "density": (1e-4, 1e4),
    "glow": (0.0, 1e4),
    "anisotropy": (-0.999, 0.999),
    "azimuth": (-360.0, 360.0),
    "elevation": (-90.0, 90.0),
    "turn": (-360.0, 360.0),
    "exposure": (-20.0, 20.0),
}
"""Of what is a number, the least and the greatest."""
_LARGEST = 1e15
"""Of a camera's numbers, and of a transfer function's."""
_POINTS = 256
"""Of a transfer function, at most."""


@dataclass(frozen=True)
class Wish:
    """One wish; None: as the scene has it.

    Parameters
    ----------
    camera : origin, target, up.
    density, glow : what extinctions and emissions are multiplied by.
    anisotropy : of all media that have one.
    azimuth, elevation : degrees of where the sun stands.
    turn : degrees by which the environment is turned.
    opacity : points of the transfer function, as (value, extinction).
    technique, transmittance : names from the registry.
    denoise : show it without its noise.
    exposure : stops, or "auto".
    """

    camera: tuple[float, ...] | None = None
    density: float = 1.0
    glow: float = 1.0
    anisotropy: float | None = None
    azimuth: float | None = None
    elevation: float | None = None
    turn: float = 0.0
    opacity: tuple[tuple[float, ...], ...] | None = None
    technique: str = "auto"
    transmittance: str = "auto"
    denoise: bool = False
    exposure: float | str = 0.0

    @classmethod
    def of(cls, given: Any) -> Wish:
        """What a page sent, checked; OptionError for what is no wish."""
        if not isinstance(given, dict):
            raise OptionError(f"a wish is an object, not {shown(given)}")
        known = {field.name for field in fields(cls)}
        if unknown := [name for name in given if name not in known]:
            raise OptionError(f"there is no {shown(unknown[0])} to wish for")
        return cls(**{name: _checked(name, value) for name, value in given.items() if value is not None})

    @property
    def rendered(self) -> tuple[Any, ...]:
        """What another render is needed for, when it changes."""
        return *self.seen, self.technique, self.transmittance

    @property
    def seen(self) -> tuple[Any, ...]:
        """What the picture depends on, but for its noise."""
        medium = self.density, self.glow, self.anisotropy, self.opacity
        return self.camera, *medium, self.azimuth, self.elevation, self.turn


def _checked(name: str, value: Any) -> Any:
    if name in ("technique", "transmittance"):
        return check_choice(name, value)
    if name == "camera":
        if not isinstance(value, list) or len(value) != _VIEW:
            raise OptionError(f"a camera has {_VIEW} numbers", hint="origin, target, up")
        return tuple(_number(name, one, -_LARGEST, _LARGEST) for one in value)
    if name == "opacity":
        if not isinstance(value, list) or not 1 <= len(value) <= _POINTS:
            raise OptionError(f"a transfer function has 1 to {_POINTS} points here")
        return tuple(_point(point) for point in value)
    if name == "denoise":
        if not isinstance(value, bool):
            raise OptionError(f"denoise must be true or false, not {shown(value)}")
        return value
    if name == "exposure" and value == "auto":
        return value
    return _number(name, value, *_LIMITS[name])


def _point(value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != 2:
        raise OptionError(f"a point of a transfer function is a value and a number, not {shown(value)}")
    return _number("value", value[0], -_LARGEST, _LARGEST), _number("opacity", value[1], 0.0, _LARGEST)


def _number(name: str, value: Any, least: float, most: float) -> float:
    """Rounded, so that a command line repeats it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and math.isfinite(value) and least <= value <= most):
        raise OptionError(f"{name} must be a number from {least:g} to {most:g}, not {shown(value)}")
    return float(f"{value:.8g}")
