"""The colour of a glowing body: Planck's law as linear sRGB of luminance 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.layout import BLACKBODY_BINS, BLACKBODY_MIDDLE_KELVIN
from clvol.scene.spectra import XYZ_TO_SRGB, observer
from clvol.tables.colours import luminance

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SECOND_RADIATION_NM_K = 1.438776877e7
"""Planck's h c / k, in nm K."""
_COLDEST_KELVIN = 1e-3
"""Far below this nothing changes any more: all that is seen is the longest wavelength."""


def blackbody_rgb(kelvin: ArrayLike) -> np.ndarray:
    """Linear sRGB of blackbodies, float64 (n, 3), clamped to at least 0 and divided by its luminance.

    `kelvin`: (n,) of any size: infinity gives the limit of hot bodies, and up to 0 there is no light.
    """
    kelvin = np.asarray(kelvin, dtype=np.float64).reshape(-1)
    wavelengths, weights = observer()
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        x = SECOND_RADIATION_NM_K / (wavelengths * np.maximum(kelvin, _COLDEST_KELVIN)[:, None])
        # Radiance up to a factor is x / (λ⁴ (eˣ - 1)), here as a logarithm: nothing under- or overflows.
        log_radiance = np.where(x > 0, np.log(x) - x - np.log(-np.expm1(-x)), 0.0)
    log_radiance -= 4.0 * np.log(wavelengths)
    log_radiance -= log_radiance.max(axis=1, keepdims=True)
    rgb = np.maximum(np.exp(log_radiance) @ weights.T @ XYZ_TO_SRGB.T, 0.0)
    return np.where(kelvin[:, None] > 0, rgb / luminance(rgb)[:, None], 0.0)


def blackbody_table(bins: int = BLACKBODY_BINS) -> np.ndarray:
    """`blackbody_rgb` for linear interpolation, float32 (bins, 3).

    Evenly spaced in u = kelvin / (kelvin + BLACKBODY_MIDDLE_KELVIN) from 0, the limit of cold bodies, to 1,
    that of hot ones.
    """
    u = np.linspace(0.0, 1.0, bins)
    with np.errstate(divide="ignore"):
        kelvin = BLACKBODY_MIDDLE_KELVIN * u / (1.0 - u)
    kelvin[0] = _COLDEST_KELVIN
    return blackbody_rgb(kelvin).astype(np.float32)
