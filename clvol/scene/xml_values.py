"""How XML writes numbers, vectors, colours and spectra; every function raises `SceneError` at its element."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from clvol.errors import SceneError, shortened

if TYPE_CHECKING:
    from clvol.scene.xml_tree import Element

_FLOAT = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_LONGEST_NUMBER = 1000
_INTEGER = re.compile(r"[+-]?\d{1,18}", re.ASCII)


def fail(element: Element, what: str, hint: str = "") -> NoReturn:
    """Raise a `SceneError` at `element`."""
    raise SceneError(what, element.where, hint)


def parse_integer(element: Element, text: str) -> int:
    """A whole number."""
    if not _INTEGER.fullmatch(text.strip()):
        fail(element, f"'{shortened(text, 60)}' is not an integer")
    return int(text)


def parse_float(element: Element, text: str) -> float:
    """A number in decimal or scientific notation."""
    if len(text) > _LONGEST_NUMBER or not _FLOAT.fullmatch(text.strip()):
        fail(element, f"'{shortened(text, 60)}' is not a number")
    return float(text)


def parse_floats(element: Element, text: str, counts: tuple[int, ...]) -> list[float]:
    """As many numbers as one of `counts`, separated by spaces or commas."""
    numbers = [parse_float(element, part) for part in re.split(r"[\s,]+", text.strip(" \t\r\n,")) if part]
    if len(numbers) not in counts:
        expected = " or ".join(str(count) for count in counts)
        fail(element, f"<{element.tag}> takes {expected} numbers here, got {len(numbers)}")
    return numbers


def parse_xyz(element: Element, attributes: dict[str, str], default: float = np.nan) -> list[float]:
    """Three numbers from `value` (one or three) or from x, y and z, which without a default must be there."""
    given = [axis for axis in "xyz" if axis in attributes]
    if "value" in attributes:
        if given:
            fail(element, f"<{element.tag}> takes either value or x, y, z, not both")
        numbers = parse_floats(element, attributes["value"], (1, 3))
        return numbers * 3 if len(numbers) == 1 else numbers
    if np.isnan(default) and len(given) < 3:
        fail(element, f"<{element.tag}> needs x, y and z, or value")
    return [parse_float(element, attributes[axis]) if axis in attributes else default for axis in "xyz"]


def parse_rgb(element: Element, text: str) -> list[float]:
    """Three numbers, or one for all."""
    numbers = parse_floats(element, text, (1, 3))
    return numbers * 3 if len(numbers) == 1 else numbers


def parse_spectrum(element: Element, text: str) -> float | list[tuple[float, float]]:
    """A number, or (wavelength in nm, value) pairs."""
    if ":" not in text:
        return parse_float(element, text)
    pairs = []
    for part in re.split(r"[\s,]+", text.strip(" \t\r\n,")):
        wavelength, separator, value = part.partition(":")
        if not separator:
            fail(element, f"'{shortened(part, 60)}' is not a wavelength:value pair")
        pairs.append((parse_float(element, wavelength), parse_float(element, value)))
    return pairs
