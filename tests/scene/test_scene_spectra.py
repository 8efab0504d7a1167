"""Spectra become the linear sRGB that Mitsuba 3.9.1 (scalar_rgb) computes: its numbers are pinned here."""

import numpy as np
import pytest

from clvol.scene.spectra import constant_to_rgb, sampled_to_rgb

# pairs, Mitsuba's radiance of a constant emitter, Mitsuba's value of a constvolume
MITSUBA = [
    (
        [(360, 1), (830, 1)],
        [1.2048836946487427, 0.9482281804084778, 0.9092668294906616],
        [0.9989852905273438, 0.9988737106323242, 0.998801589012146],
    ),
    (
        [(400, 1), (500, 2), (600, 3), (700, 1)],
        [3.273303508758545, 2.370931386947632, 1.2525256872177124],
        [2.778642416000366, 2.4765756130218506, 1.4098567962646484],
    ),
    (
        [(360, 0), (595, 1), (830, 0)],
        [1.1509833335876465, 0.7597184777259827, 0.3026486039161682],
        [0.9809357523918152, 0.7930430769920349, 0.34609097242355347],
    ),
    ([(500, 0), (520, 1), (540, 0)], [0, 0.22927282750606537, 0], [0, 0.24629533290863037, 0]),
    ([(600, 0), (830, 1)], [0.11039963364601135, 0, 0], [0.09266018867492676, 0, 0]),
]


@pytest.mark.parametrize(("pairs", "light", "other"), MITSUBA)
def test_sampled_spectra_agree_with_mitsuba(pairs, light, other):
    wavelengths, values = zip(*pairs, strict=True)
    np.testing.assert_allclose(sampled_to_rgb(wavelengths, values, light=True), light, rtol=3e-5)
    np.testing.assert_allclose(sampled_to_rgb(wavelengths, values, light=False), other, rtol=3e-5)


def test_a_constant_light_is_equal_energy_white():
    np.testing.assert_allclose(constant_to_rgb(2.0), [2.409588, 1.896582, 1.817832], rtol=1e-6)
