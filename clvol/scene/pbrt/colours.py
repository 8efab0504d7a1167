"""What pbrt's colours are in linear sRGB: rgb in a colour space, spectra, black bodies and named spectra.

pbrt divides a light's spectrum by its luminance, and an rgb one's white by that of the colour space's
illuminant, so that a light of scale 1 has luminance 1 (`SpectrumToPhotometric`; the sensor integrates without
dividing by the integral of y-bar).  So an "rgb L" is the picture's colour as it is.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import SceneError, shortened
from clvol.scene.lookup import find
from clvol.scene.pbrt.tokens import read_bytes
from clvol.scene.refraction import METALS
from clvol.scene.spectra import XYZ_TO_SRGB, Y_INTEGRAL, observer, sampled_to_rgb
from clvol.scene.vocabulary import did_you_mean, join_hints, listed

if TYPE_CHECKING:
    from pathlib import Path

    from clvol.scene.pbrt.parameters import Parameter

_PRIMARIES = {  # x and y of red, green, blue and white
    "srgb": ((0.64, 0.33), (0.3, 0.6), (0.15, 0.06), (0.3127, 0.329)),
    "dci-p3": ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06), (0.3127, 0.329)),
    "rec2020": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046), (0.3127, 0.329)),
    "aces2065-1": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), (0.32168, 0.33767)),
}
SPACES = tuple(_PRIMARIES)
"""Names of pbrt's colour spaces."""
_BLACK_ILLUMINANTS = {"stdillum-A": 2856.0}
GLASSES = {
    "glass-BK7": 1.5168,
    "glass-BAF10": 1.67003,
    "glass-FK51A": 1.48656,
    "glass-LASF9": 1.85025,
    "glass-F5": 1.67271,
    "glass-F10": 1.72828,
    "glass-F11": 1.78472,
}
"""Refractive indices at 587.6 nm, of Schott's data sheets (pbrt's F5, F10 and F11 are SF5, SF10 and SF11)."""
HOTTEST = 1e6
_H, _C, _K = 6.62607015e-34, 299792458.0, 1.380649e-23
_WIEN = 2.897771955e-3


@cache
def to_srgb(space: str, light: bool) -> np.ndarray:
    """The 3x3 matrix from a space's rgb to linear sRGB.

    Of reflectances and coefficients white stays white; `light`: it keeps the colour that it has.
    """
    red, green, blue, white = (np.array([x / y, 1, (1 - x - y) / y]) for x, y in _xy(space))
    primaries = np.stack([red, green, blue], axis=1)
    matrix: np.ndarray = XYZ_TO_SRGB @ (primaries * np.linalg.solve(primaries, white))
    if space == "srgb":
        return np.eye(3)
    if not light:
        matrix = matrix / (matrix @ np.ones(3))[:, None]
    return matrix


def _xy(space: str) -> list[tuple[float, float]]:
    return [(x, y or 1e-9) for x, y in _PRIMARIES[space]]


def colour(parameter: Parameter, space: str, folders: list[Path], bounded: bool = False) -> np.ndarray:
    """A reflectance (`bounded`), coefficient or refractive index, float64 (3,), >= 0.

    Raises
    ------
    SceneError
        Not of a known kind, or negative.
    """
    if parameter.type == "rgb":
        found = to_srgb(space, light=False) @ _rgb(parameter)
        clipped: np.ndarray = np.clip(found, 0, 1 if bounded else np.inf)
        return clipped
    if parameter.type == "float":
        if len(parameter.numbers) != 1 or parameter.numbers[0] < 0:
            raise SceneError(f"'{parameter.name}' takes one number >= 0", parameter.where)
        return np.full(3, parameter.numbers[0])
    if parameter.type != "spectrum":
        raise SceneError(f"'{parameter.name}' cannot be a {parameter.type}", parameter.where)
    named = _named(parameter)
    if named is not None:
        return named
    at, values = _sampled(parameter, folders)
    if (values == values[0]).all():
        return np.full(3, values[0])
    found = sampled_to_rgb(at, values, light=False)
    return np.minimum(found, 1) if bounded else found


def light_colour(parameter: Parameter, space: str, folders: list[Path]) -> np.ndarray:
    """What a light of scale 1 with this spectrum shows, float64 (3,): luminance 1, but an rgb as it is."""
    if parameter.type == "rgb":
        shown: np.ndarray = np.maximum(to_srgb(space, light=True) @ _rgb(parameter), 0)
        return shown
    if parameter.type == "blackbody":
        if len(parameter.numbers) != 1 or not 0 < parameter.numbers[0] <= HOTTEST:
            raise SceneError(f"'{parameter.name}' takes one temperature in kelvin", parameter.where)
        return _of_luminance_one(*black_body(parameter.numbers[0]))
    if parameter.type != "spectrum":
        raise SceneError(f"'{parameter.name}' cannot be a {parameter.type}", parameter.where)
    if not isinstance(parameter.values, np.ndarray):
        name = parameter.texts[0] if parameter.texts else ""
        if name == "stdillum-D65":
            return np.ones(3)
        if name in _BLACK_ILLUMINANTS:
            return _of_luminance_one(*black_body(_BLACK_ILLUMINANTS[name]))
    return _of_luminance_one(*_sampled(parameter, folders))


def white(space: str) -> np.ndarray:
    """What a light shows that gives no spectrum: its colour space's illuminant."""
    return np.maximum(to_srgb(space, light=True) @ np.ones(3), 0)


def _of_luminance_one(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    wavelengths, weights = observer()
    luminance = float(weights[1] @ np.interp(wavelengths, at, values, left=0.0, right=0.0))
    return sampled_to_rgb(at, values, light=True) / luminance if luminance > 0 else np.zeros(3)


def black_body(kelvin: float) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths in nm and the emission of a black body there, 1 at its peak."""
    at, _ = observer()

    def planck(metres: np.ndarray | float) -> np.ndarray:
        exponent = np.minimum(_H * _C / (metres * _K * kelvin), 700.0)
        emitted: np.ndarray = 1 / (np.asarray(metres) ** 5 * np.expm1(exponent))
        return emitted

    return at, planck(at * 1e-9) / planck(_WIEN / kelvin)


@cache
def glow() -> tuple[np.ndarray, np.ndarray]:
    """Temperatures, float64 (n,), and what a medium of pbrt's that hot shows, (n, 3): 0 up to 100 K.

    The black body is 1 at its peak, whatever its luminance, and the sensor integrates y-bar as it is.
    """
    kelvin = np.concatenate([[0.0, 100.0], np.geomspace(100.0 * (1 + 1e-9), HOTTEST, 2000)])
    shown = [sampled_to_rgb(*black_body(one), light=True) * Y_INTEGRAL for one in kelvin[2:]]
    return kelvin, np.concatenate([np.zeros((2, 3)), shown])


def _rgb(parameter: Parameter) -> np.ndarray:
    if len(parameter.numbers) != 3 or (parameter.numbers < 0).any():
        raise SceneError(f"'{parameter.name}' takes three numbers >= 0", parameter.where)
    return parameter.numbers


def _named(parameter: Parameter) -> np.ndarray | None:
    """A metal's or a glass's spectrum by its name; None for others."""
    if isinstance(parameter.values, np.ndarray) or not parameter.texts:
        return None
    name = parameter.texts[0]
    if name in GLASSES:
        return np.full(3, GLASSES[name])
    words = name.split("-")
    if words[0] == "metal" and len(words) == 3 and words[2] in ("eta", "k"):
        if words[1] not in METALS:
            hint = f"supported: {listed(METALS)}"
            raise SceneError(f"unknown metal '{shortened(words[1], 40)}'", parameter.where, hint)
        return np.array(METALS[words[1]][0 if words[2] == "eta" else 1])
    return None


def _sampled(parameter: Parameter, folders: list[Path]) -> tuple[np.ndarray, np.ndarray]:
    """Increasing wavelengths in nm and values, from pairs or from the file of such pairs that is named."""
    pairs = parameter.values
    if not isinstance(pairs, np.ndarray):
        pairs = _from_file(parameter, folders)
    if len(pairs) < 4 or len(pairs) % 2:
        raise SceneError(f"'{parameter.name}' takes pairs of a wavelength and a value", parameter.where)
    at, values = pairs.reshape(-1, 2).T
    if (np.diff(at) <= 0).any() or (values < 0).any():
        raise SceneError(f"'{parameter.name}' takes increasing wavelengths, and values >= 0", parameter.where)
    return at, values


def _from_file(parameter: Parameter, folders: list[Path]) -> np.ndarray:
    name = parameter.texts[0] if len(parameter.texts) == 1 else ""
    known = ("stdillum-D65", *_BLACK_ILLUMINANTS, *GLASSES)
    if not name or "." not in name:
        hint = join_hints(did_you_mean(name, known), f"supported: files, metals, {listed(known)}")
        raise SceneError(f"unknown spectrum '{shortened(name, 60)}'", parameter.where, hint)
    path = find(name, folders, parameter.where)
    lines = (line.partition(b"#")[0] for line in read_bytes(path, parameter.where).splitlines())
    try:
        return np.array([float(word) for line in lines for word in line.split()])
    except ValueError:
        raise SceneError(f"'{path}' holds no pairs of numbers", parameter.where) from None
