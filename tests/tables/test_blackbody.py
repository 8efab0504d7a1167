"""Blackbodies have the published colours, at any temperature, and the device's table interpolates to them."""

import numpy as np
import pytest

from clvol.layout import BLACKBODY_BINS, BLACKBODY_MIDDLE_KELVIN
from clvol.scene.spectra import XYZ_TO_SRGB, sampled_to_rgb
from clvol.tables.blackbody import blackbody_rgb, blackbody_table
from clvol.tables.colours import luminance

LOCUS = [  # CIE 1931 2°: kelvin, x, y of the Planckian locus
    (2000, 0.5267, 0.4133),
    (3000, 0.4369, 0.4041),
    (6500, 0.3135, 0.3237),
    (10000, 0.2807, 0.2884),
]


@pytest.mark.parametrize(("kelvin", "x", "y"), LOCUS)
def test_chromaticities_are_those_of_the_planckian_locus(kelvin, x, y):
    xyz = np.linalg.inv(XYZ_TO_SRGB) @ blackbody_rgb([kelvin])[0]
    assert xyz[:2] / xyz.sum() == pytest.approx([x, y], abs=1e-3)


def test_colours_are_those_of_plancks_law_as_a_measured_spectrum():
    wavelengths = np.linspace(360, 830, 2000)
    for kelvin in (1500, 4000, 20000):
        radiance = wavelengths**-5.0 / np.expm1(1.438776877e7 / (wavelengths * kelvin))
        rgb = sampled_to_rgb(wavelengths, radiance / radiance.max(), light=True)
        np.testing.assert_allclose(blackbody_rgb([kelvin])[0], rgb / luminance(rgb), rtol=1e-4, atol=1e-9)


def test_daylight_is_nearly_white_and_embers_are_red():
    assert blackbody_rgb([6504])[0] == pytest.approx([1, 1, 1], abs=0.05)
    red, green, blue = blackbody_rgb([1200])[0]
    assert red > 15 * green > 0 == blue


def test_every_temperature_has_a_colour_of_luminance_one():
    kelvin = np.concatenate([np.geomspace(1e-300, 1e300, 601), [50.0, np.inf]])
    rgb = blackbody_rgb(kelvin)
    assert rgb.shape == (603, 3)
    assert rgb.min() >= 0
    np.testing.assert_allclose(luminance(rgb), 1.0, rtol=1e-12)
    np.testing.assert_allclose(rgb[0], rgb[kelvin == 50.0][0], rtol=1e-6)  # the limit of cold bodies
    np.testing.assert_allclose(blackbody_rgb([1e12]), rgb[-1:], rtol=1e-6)  # and of hot ones


def test_what_has_no_temperature_does_not_glow():
    assert (blackbody_rgb([0.0, -1.0, -np.inf]) == 0).all()


def interpolated(kelvin, table):
    """As the device reads the table."""
    at = kelvin / (kelvin + BLACKBODY_MIDDLE_KELVIN) * (len(table) - 1)
    bin_ = np.minimum(at.astype(int), len(table) - 2)
    part = (at - bin_)[:, None]
    return (1 - part) * table[bin_] + part * table[bin_ + 1].astype(float)


def test_the_table_interpolates_to_the_exact_colours():
    kelvin = np.geomspace(300, 40000, 20_001)
    exact = blackbody_rgb(kelvin)
    table = blackbody_table()
    assert (table.dtype, table.shape) == (np.float32, (BLACKBODY_BINS, 3))
    assert np.isfinite(table).all()
    error = np.abs(interpolated(kelvin, table) - exact).max(axis=1) / exact.max(axis=1)
    assert error.max() < 1e-3
    coarse = np.abs(interpolated(kelvin, blackbody_table(64)) - exact).max(axis=1) / exact.max(axis=1)
    assert coarse.max() > 1e-3
