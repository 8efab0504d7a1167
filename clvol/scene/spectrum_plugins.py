"""Spectra that are plugins of their own, as the colours that Mitsuba's rgb variants see in them.

Where these have no colour for one (`regular`, `irregular`, `blackbody`), it is what the spectral variants see
in it, turned to linear sRGB.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.errors import shortened
from clvol.scene import spectra
from clvol.scene.records import SpectrumColor

if TYPE_CHECKING:
    from clvol.scene.reader import Reader

PLANCK, LIGHT, BOLTZMANN = 6.62607015e-34, 299792458.0, 1.380649e-23
MAX_NUMBERS = 1 << 16
"""Most wavelengths of a spectrum."""


def uniform(reader: Reader) -> SpectrumColor:
    """The `uniform` spectrum: the same value, which is a grey one."""
    grey = np.array([reader.number("value", 1.0)])
    return SpectrumColor(grey, grey)


def rawconstant(reader: Reader) -> SpectrumColor:
    """The `rawconstant` spectrum: a number, or three in a row."""
    return _given(reader.vector("value", 1.0)) if _is_row(reader, "value") else uniform(reader)


def srgb(reader: Reader) -> SpectrumColor:
    """The `srgb` spectrum: its colour."""
    return _given(_color(reader))


def d65(reader: Reader) -> SpectrumColor:
    """The `d65` spectrum: daylight is white, times `color` and `scale`."""
    return _given(reader.number("scale", 1.0) * _color(reader))


def regular(reader: Reader) -> SpectrumColor:
    """The `regular` spectrum: `values` at even steps from wavelength_min to wavelength_max."""
    values = _numbers(reader, "values")
    first, last = reader.number("wavelength_min", 360.0, 0.0), reader.number("wavelength_max", 830.0, 0.0)
    if not first < last:
        reader.fail("wavelength_max must be greater than wavelength_min", "wavelength_max")
    return _sampled(np.linspace(first, last, len(values)), values)


def irregular(reader: Reader) -> SpectrumColor:
    """The `irregular` spectrum: `values` at `wavelengths`."""
    wavelengths, values = _numbers(reader, "wavelengths"), _numbers(reader, "values")
    if len(wavelengths) != len(values):
        reader.fail(f"{len(wavelengths)} wavelengths have {len(values)} values", "values")
    if (np.diff(wavelengths) <= 0).any():
        reader.fail("wavelengths must increase", "wavelengths")
    return _sampled(wavelengths, values)


def blackbody(reader: Reader) -> SpectrumColor:
    """The `blackbody` spectrum: Planck's law, in W / (m² sr nm)."""
    kelvin = reader.number("temperature", 5000.0, 0.0, 1e9, open_interval=True)
    first, last = reader.number("wavelength_min", 360.0, 0.0), reader.number("wavelength_max", 830.0, 0.0)
    nanometres = np.linspace(spectra.FIRST_NM, spectra.LAST_NM, 1000)
    metres = 1e-9 * nanometres
    with np.errstate(over="ignore"):
        exponential = np.expm1(PLANCK * LIGHT / (metres * BOLTZMANN * kelvin))
    radiance = 1e-9 * 2 * PLANCK * LIGHT**2 / (metres**5 * exponential)
    return _sampled(nanometres, np.where((first <= nanometres) & (nanometres <= last), radiance, 0.0))


SPECTRA = {
    "uniform": uniform,
    "rawconstant": rawconstant,
    "srgb": srgb,
    "d65": d65,
    "regular": regular,
    "irregular": irregular,
    "blackbody": blackbody,
}


def _given(color: np.ndarray) -> SpectrumColor:
    """A colour that is the same of lights and of surfaces."""
    return SpectrumColor(color, color)


def _color(reader: Reader) -> np.ndarray:
    """The parameter `color`: an rgb, or three numbers in a row."""
    return reader.vector("color", 1.0) if _is_row(reader, "color") else np.array(reader.color("color", 1.0))


def _is_row(reader: Reader, name: str) -> bool:
    return isinstance(reader.node.get(name), list | tuple | np.ndarray)


def _sampled(wavelengths: np.ndarray, values: np.ndarray) -> SpectrumColor:
    return SpectrumColor(*(spectra.sampled_to_rgb(wavelengths, values, light) for light in (True, False)))


def _numbers(reader: Reader, name: str) -> np.ndarray:
    """At least two finite numbers >= 0, between commas or blanks or in an array."""
    if not reader.has(name):
        reader.fail(f"the spectrum '{reader.type}' needs {name}")
    value = reader.raw(name)
    if isinstance(value, str):
        words = value.replace(",", " ").split()
        numbers = np.empty(len(words))
        for n, word in enumerate(words):
            try:
                numbers[n] = float(word)
            except ValueError:
                reader.fail(f"'{name}' has '{shortened(word, 40)}', which is no number", name)
    else:
        numbers = np.ma.filled(reader.array(name).astype(np.float64), np.nan)
    if numbers.ndim != 1 or not 2 <= len(numbers) <= MAX_NUMBERS:
        reader.fail(f"'{name}' of '{reader.type}' must be 2 to {MAX_NUMBERS} numbers in a row", name)
    if not (np.isfinite(numbers) & (numbers >= 0)).all():
        reader.fail(f"'{name}' of '{reader.type}' must be finite and >= 0", name)
    return numbers
