"""What pbrt's scenes are made of: the cloud's noise, the environment's map, colours of hot media."""

from __future__ import annotations

import numpy as np
import pytest

from clvol.scene.pbrt import cloud
from clvol.scene.pbrt.cloud import cloud_density, noise
from clvol.scene.pbrt.colours import glow, to_srgb
from clvol.scene.pbrt.lights import latitudes_and_longitudes, square_place
from clvol.scene.spectra import Y_INTEGRAL


def test_noise_is_that_of_perlins_reference():
    """The value of his Java program at this point."""
    assert noise(*np.array([[3.14], [42.0], [7.0]])) == pytest.approx(0.13691995878400012, abs=1e-12)


def test_gradients_are_those_of_pbrts_source():
    """Their first part is x, or y for 8 to 11, 14 and 15; the second y or z; the last bits are signs."""
    way = np.array([0.3, 0.5, 0.7])
    for hashed in range(16):
        first = way[0] if hashed < 8 or hashed in (12, 13) else way[1]
        second = way[1] if hashed < 4 or hashed in (12, 13) else way[2]
        expected = (-first if hashed & 1 else first) + (-second if hashed & 2 else second)
        assert cloud._slope(np.array([hashed]), *way)[0] == pytest.approx(expected)


def test_a_cloud_is_solid_below():
    """At least 2 (½ - y) whatever the noise, which fades towards y = 1."""
    density = cloud_density(np.zeros(3), np.array([0.05, 1, 0.05]), 1.0, 1.0, 5.0)
    y = (np.arange(density.shape[1]) + 0.5) / density.shape[1]
    assert (density >= np.clip(2 * (0.5 - y), 0, 1)[None, :, None] - 1e-6).all() and density.max() <= 1
    assert density[:, y > 0.98].max() < 0.1 < density[:, np.abs(y - 0.5) < 0.1].max()


@pytest.mark.parametrize(
    ("direction", "place"),
    [
        ((0, 0, 1), (0.5, 0.5)),
        ((1, 0, 0), (1, 0.5)),
        ((0, 1, 0), (0.5, 1)),
        ((-1, 0, 0), (0, 0.5)),
        ((0, -1, 0), (0.5, 0)),
        ((1e-9, 1e-9, -1), (1, 1)),
    ],
)
def test_directions_in_the_square(direction, place):
    """Clarberg's map: up in the middle, down in the corners, the horizon between them."""
    assert square_place(*map(np.array, direction)) == pytest.approx(place, abs=1e-6)


def test_an_environment_is_where_it_was():
    """A square that is bright about +z alone: in Mitsuba's map that is u = ½ on the equator."""
    square = np.zeros((64, 64, 3), np.float32)
    square[28:36, 28:36] = 1
    made = latitudes_and_longitudes(square)[..., 0]
    row, column = np.argwhere(made > 0.5).mean(axis=0)
    assert (row, column) == pytest.approx((31.5, 63.5), abs=0.6)


def test_hot_media_show_nothing_below_100_kelvin_and_are_1_at_the_peak():
    kelvin, shown = glow()
    assert (shown[kelvin <= 100] == 0).all()
    at_5200 = np.array([np.interp(5200, kelvin, one) for one in shown.T])  # peaks at 557 nm, where y-bar does
    assert at_5200 @ [0.2126, 0.7152, 0.0722] == pytest.approx(Y_INTEGRAL, rel=0.05)


def test_colour_spaces_keep_white_as_a_reflectance():
    for space in ("dci-p3", "rec2020", "aces2065-1"):
        assert to_srgb(space, light=False) @ np.ones(3) == pytest.approx(np.ones(3))
    assert to_srgb("rec2020", light=True) @ np.ones(3) == pytest.approx(np.ones(3), abs=2e-3)
