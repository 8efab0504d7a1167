"""Measured spectra to linear sRGB through the CIE 1931 2° observer, with Mitsuba's normalisation.

Tables: CIE 015:2018 (observer in 5 nm steps, D65 in 10 nm steps, both from 360 to 830 nm), to five digits.
"""

from __future__ import annotations

from functools import cache

import numpy as np

_X = """
.0001299 .0002321 .0004149 .0007416 .001368 .002236 .004243 .00765 .01431 .02319 .04351 .07763 .13438
.21477 .2839 .3285 .34828 .34806 .3362 .3187 .2908 .2511 .19536 .1421 .09564 .05795 .03201 .0147 .0049
.0024 .0093 .0291 .06327 .1096 .1655 .22575 .2904 .3597 .43345 .51205 .5945 .6784 .7621 .8425 .9163
.9786 1.0263 1.0567 1.0622 1.0456 1.0026 .9384 .85445 .7514 .6424 .5419 .4479 .3608 .2835 .2187 .1649
.1212 .0874 .0636 .04677 .0329 .0227 .01584 .011359 .0081109 .0057903 .0041095 .0028993 .0020492 .00144
.00099995 .00069008 .00047602 .0003323 .00023483 .00016615 .00011741 8.3075e-5 5.8707e-5 4.151e-5
2.9353e-5 2.0674e-5 1.456e-5 1.0254e-5 7.2215e-6 5.0859e-6 3.5817e-6 2.5225e-6 1.7765e-6 1.2511e-6
"""
_Y = """
3.917e-6 6.965e-6 1.239e-5 2.202e-5 3.9e-5 6.4e-5 .00012 .000217 .000396 .00064 .00121 .00218 .004 .0073
.0116 .01684 .023 .0298 .038 .048 .06 .0739 .09098 .1126 .13902 .1693 .20802 .2586 .323 .4073 .503 .6082
.71 .7932 .862 .91485 .954 .9803 .99495 1 .995 .9786 .952 .9154 .87 .8163 .757 .6949 .631 .5668 .503
.4412 .381 .321 .265 .217 .175 .1382 .107 .0816 .061 .04458 .032 .0232 .017 .01192 .00821 .005723
.004102 .002929 .002091 .001484 .001047 .00074 .00052 .0003611 .0002492 .0001719 .00012 8.48e-5 6e-5
4.24e-5 3e-5 2.12e-5 1.499e-5 1.06e-5 7.4657e-6 5.2578e-6 3.7029e-6 2.6078e-6 1.8366e-6 1.2934e-6
9.1093e-7 6.4153e-7 4.5181e-7
"""
_Z = """
.0006061 .001086 .001946 .003486 .00645 .01055 .02005 .03621 .06785 .1102 .2074 .3713 .6456 1.0391
1.3856 1.623 1.7471 1.7826 1.7721 1.7441 1.6692 1.5281 1.2876 1.0419 .81295 .6162 .46518 .3533 .272
.2123 .1582 .1117 .07825 .05725 .04216 .02984 .0203 .0134 .00875 .00575 .0039 .00275 .0021 .0018 .00165
.0014 .0011 .001 .0008 .0006 .00034 .00024 .00019 .0001 5e-5 3e-5 2e-5 1e-5
"""
_D65 = """
46.638 52.089 49.975 54.648 82.755 91.486 93.432 86.682 104.86 117.01 117.81 114.86 115.92 108.81 109.35
107.8 104.79 107.69 104.41 104.05 100 96.334 95.788 88.686 90.006 89.599 87.699 83.289 83.699 80.027
80.215 82.278 78.284 69.721 71.609 74.349 61.604 69.886 75.087 63.593 46.418 66.805 63.383 64.304 59.452
51.959 57.441 60.312
"""
FIRST_NM, LAST_NM = 360.0, 830.0
Y_INTEGRAL = 106.856895
"""Integral of the table's y-bar over wavelength, in nm."""
D65_NORMALISATION = 98.99741751876255
"""Mitsuba's luminance of D65; 0.1 % above the integral of these tables, kept so that pictures agree."""
XYZ_TO_SRGB = np.array(
    [
        [3.240479, -1.537150, -0.498535],
        [-0.969256, 1.875991, 0.041556],
        [0.055648, -0.204043, 1.057311],
    ]
)


def _sampled(text: str, step: float, wavelengths: np.ndarray) -> np.ndarray:
    """A table (values from `FIRST_NM` every `step` nm, 0 after its end) interpolated at `wavelengths`."""
    values = np.array(text.split(), dtype=np.float64)
    at = FIRST_NM + step * np.arange(len(values))
    found: np.ndarray = np.interp(wavelengths, at, values, right=0.0)
    return found


@cache
def observer() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths in nm, float64 (n,), and the weights (3, n) that turn a spectrum there into XYZ."""
    at = np.linspace(FIRST_NM, LAST_NM, 1000)
    weights = np.stack([_sampled(table, 5.0, at) for table in (_X, _Y, _Z)])
    return at, weights * ((at[1] - at[0]) / Y_INTEGRAL)


def constant_to_rgb(value: float) -> np.ndarray:
    """Linear sRGB, float64 (3,), of a spectrum of the same `value` everywhere under equal energy."""
    white: np.ndarray = XYZ_TO_SRGB.sum(axis=1)
    return value * white


def sampled_to_rgb(wavelengths: np.ndarray, values: np.ndarray, light: bool) -> np.ndarray:
    """Linear sRGB, float64 (3,), of a spectrum given at `wavelengths` (nm, increasing), 0 outside them.

    A `light` is weighted by the observer alone (equal energy), anything else by D65 as well.  Colours
    outside the gamut are cut at 0, as in Mitsuba.
    """
    at, weights = observer()
    if not light:
        weights = weights * (_sampled(_D65, 10.0, at) / D65_NORMALISATION)
    xyz = weights @ np.interp(at, wavelengths, values, left=0.0, right=0.0)
    rgb: np.ndarray = np.maximum(XYZ_TO_SRGB @ xyz, 0.0)
    return rgb


def srgb_to_linear(encoded: np.ndarray) -> np.ndarray:
    """Inverse of the sRGB transfer curve for values in [0, 1]."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
