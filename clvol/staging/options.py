"""What a user may say of how a volume is shown: described once, for the command line and for Python."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from clvol.errors import OptionError, shown
from clvol.staging.looks import LOOKS
from clvol.staging.presets import PRESETS

VIEWS = {
    "front": (0.0, 0.0),
    "right": (90.0, 0.0),
    "back": (180.0, 0.0),
    "left": (270.0, 0.0),
    "top": (0.0, 90.0),
    "three-quarter": (35.0, 18.0),
}
"""Azimuth and elevation of the camera, in degrees."""
UPS = ("y", "z")
Value = Callable[[str, Any], Any]
"""Takes an option's name and what was given, as text too; OptionError if it won't do."""

TRANSPARENT = "transparent"


def _wrong(name: str, expected: str, value: object) -> OptionError:
    return OptionError(f"{name} must be {expected}, not {shown(value)}")


def text(name: str, value: Any) -> str:
    """A string."""
    if not isinstance(value, str) or not value:
        raise _wrong(name, "a name", value)
    return value


def number(low: float = -math.inf, high: float = math.inf, above: bool = False) -> Value:
    """A finite number from `low` to `high`; without `low` itself where it must be above."""

    def check(name: str, value: Any) -> float:
        found = _numbers(value)
        inside = len(found) == 1 and low <= found[0] <= high and not (above and found[0] == low)
        if not inside:
            limits = [f"above {low:g}" if above else f"from {low:g}"] if math.isfinite(low) else []
            limits += [f"to {high:g}"] if math.isfinite(high) else []
            raise _wrong(name, " ".join(["a number", *limits]), value)
        return found[0]

    return check


def choice(*names: str) -> Value:
    """One of these names."""

    def check(name: str, value: Any) -> str:
        if isinstance(value, str) and value in names:
            return str(value)
        close = difflib.get_close_matches(str(value)[:64], names, n=1)
        guess = f"did you mean '{close[0]}'? " if close else ""
        raise OptionError(f"unknown {name} {shown(value)}", hint=f"{guess}choose one of {', '.join(names)}")

    return check


def spectrum(high: float = math.inf) -> Value:
    """A number or three of them, for red, green and blue, from 0 to `high`."""

    def check(name: str, value: Any) -> tuple[float, ...]:
        found = _numbers(value)
        if len(found) not in (1, 3) or not all(0 <= one <= high for one in found):
            limit = f" from 0 to {high:g}" if math.isfinite(high) else " of at least 0"
            raise _wrong(name, f"one number or three as 0.9,0.8,0.7,{limit}", value)
        return tuple(found)

    return check


def colour(name: str, value: Any) -> tuple[float, ...]:
    """A colour as linear radiance, from a name, #rrggbb (sRGB), a number or three."""
    from clvol.staging.colours import NAMES, radiance_of

    if isinstance(value, str) and (known := radiance_of(value)) is not None:
        return known
    found = _numbers(value)
    if len(found) not in (1, 3) or min(found) < 0:
        close = difflib.get_close_matches(value.lower()[:64], NAMES, n=1) if isinstance(value, str) else []
        hint = f"did you mean '{close[0]}'? " if close else ""
        expected = "a colour: a name, #rrggbb, or numbers of linear radiance as 0.1,0.2,0.3"
        raise OptionError(
            f"{name} must be {expected}, not {shown(value)}", hint=f"{hint}names are {', '.join(NAMES)}"
        )
    return tuple(found)


def background(name: str, value: Any) -> str | tuple[float, ...]:
    """A colour, or "transparent"."""
    transparent = isinstance(value, str) and value == TRANSPARENT
    return TRANSPARENT if transparent else colour(name, value)


def direction(name: str, value: Any) -> tuple[float, ...]:
    """Three numbers that are not all 0."""
    found = _numbers(value)
    if len(found) != 3 or not any(found):
        raise _wrong(name, "a direction as 1,2,-0.5", value)
    largest = max(map(abs, found))
    return tuple(one / largest for one in found)


def light(name: str, value: Any) -> str:
    """A look by name, or the file of an environment."""
    if isinstance(value, Path) or (isinstance(value, str) and Path(value).suffix):
        if not Path(value).is_file():
            raise OptionError(f"{name}: no such file", str(value), f"or choose one of {', '.join(LOOKS)}")
        return str(value)
    return str(choice(*LOOKS)(name, value))


def look(name: str, value: Any) -> Any:
    """A transfer function: a preset by name, or what `clvol.transfer` takes."""
    from clvol.staging.transfer import look_option

    return look_option(name, value)


def flag(name: str, value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise _wrong(name, "true or false", value)
    return value


def _numbers(value: Any) -> list[float]:
    """The finite numbers of a value, or of text with commas or spaces; none where it is anything else."""
    if isinstance(value, str):
        value = re.split(r"[,\s]+", value.strip())
    elif isinstance(value, Real):
        value = [value]
    try:
        found = [float(one) for one in value if not isinstance(one, bool)]
        whole = len(found) == len(value) and all(map(math.isfinite, found))
    except (TypeError, ValueError, OverflowError):
        return []
    return found if whole else []


@dataclass(frozen=True)
class Option:
    """One option: what it may be, how the command line writes it, and what it does.  The default is None."""

    check: Value
    metavar: str
    help: str
    also: tuple[str, ...] = ()

    @property
    def is_flag(self) -> bool:
        """Whether it is there or not, without a value."""
        return self.check is flag


OPTIONS: dict[str, Option] = {
    "density": Option(text, "GRID", "Grid of the density; by its usual names otherwise."),
    "temperature": Option(text, "GRID", "Grid of the temperature; none: leave it out."),
    "flame": Option(text, "GRID", "Grid of what glows; none: leave it out."),
    "colour": Option(text, "GRID", "Grid of the colour, as Cd; none: leave it out.", ("--color",)),
    "level_set": Option(choice("fog"), "fog", "Take the density for a level set, and fill it with fog."),
    "sanitize": Option(flag, "", "Take NaN and slightly negative samples as 0, and count them."),
    "transfer": Option(
        look,
        "NAME",
        f"Look of scanned or simulated values: {'|'.join(PRESETS)}.",
    ),
    "density_scale": Option(
        number(0, 1e15, above=True),
        "X",
        "Extinction of density 1; chosen by how thick the volume then looks.",
    ),
    "albedo": Option(spectrum(1), "A", "Share of light that is scattered: one number, or R,G,B."),
    "anisotropy": Option(number(-0.999, 0.999), "G", "Mean cosine of scattering: 0 all round, 0.8 ahead."),
    "temperature_scale": Option(number(0, 1e9, above=True), "X", "Kelvin of temperature 1."),
    "emission_scale": Option(number(0, 1e15), "X", "How bright it glows; 0: not at all."),
    "light": Option(light, "LIGHT", f"{'|'.join(LOOKS)}, or FILE.exr of an environment."),
    "sun_direction": Option(direction, "X,Y,Z", "Where the sun, or the main lamp, stands from the volume."),
    "view": Option(choice(*VIEWS), "VIEW", f"{'|'.join(VIEWS)}."),
    "azimuth": Option(number(-3600, 3600), "DEG", "Degrees of the camera round it: 0 front, 90 right."),
    "elevation": Option(number(-90, 90), "DEG", "Degrees of the camera above the horizon."),
    "distance": Option(
        number(1e-3, 1e3), "FACTOR", "Closer (0.5) or farther (2) than where it fits the picture."
    ),
    "up": Option(choice(*UPS), "AXIS", "y or z; guessed by who wrote the file."),
    "ground": Option(flag, "", "Put it on a floor that takes its shadow."),
    "background": Option(
        background, "COLOUR", "Colour behind it: a name, #rrggbb, or linear R,G,B; or transparent."
    ),
}
"""By name, as Python spells it."""
DEFAULTS = {"view": "three-quarter", "distance": 1.0, "ground": False}


def checked(given: Mapping[str, Any]) -> SimpleNamespace:
    """Every option by name: what is given, checked; the default, or None, for others.

    Raises
    ------
    OptionError : a value that won't do, or two options that contradict each other.
    TypeError : a name that is no option.
    """
    for name in given:
        if name not in OPTIONS:
            close = difflib.get_close_matches(name, OPTIONS, n=1)
            hint = f", did you mean '{close[0]}'?" if close else f": they are {', '.join(OPTIONS)}"
            raise TypeError(f"there is no option '{name}' for a volume{hint}")
    values = dict.fromkeys(OPTIONS) | DEFAULTS
    values |= {name: OPTIONS[name].check(name, value) for name, value in given.items() if value is not None}
    angles = [name for name in ("azimuth", "elevation") if values[name] is not None]
    if angles and given.get("view") is not None:
        raise OptionError(f"view and {angles[0]} exclude each other", hint="give a view by name or by angles")
    return SimpleNamespace(**values)
