"""Coloured grids that are a grey one times a colour become just that; all others stay as they are."""

import numpy as np
import pytest

from clvol.volumes import DenseGrid
from clvol.volumes.proportional import TOLERANCE, proportional_channels

UNIT_BOX = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
FACTORS = np.array([0.2, 1.0, 0.7])


def coloured(factors=FACTORS, size=9):
    """A grid with zeros in it, in float32."""
    density = np.maximum(np.random.default_rng(1).uniform(-0.5, 3, (size, size, size, 1)), 0)
    return (density * factors).astype(np.float32)


def reduced(values):
    return proportional_channels(DenseGrid(values, UNIT_BOX, "density", "fog.vol"))


@pytest.mark.parametrize("factors", [FACTORS, [1, 0, 0], [0.3, 0.3, 0.1]])
def test_channels_are_one_channel_times_factors(factors):
    values = coloured(np.array(factors))
    grid, found = reduced(values)
    assert grid.values.shape == (9, 9, 9, 1)
    assert grid.values.flags.c_contiguous and grid.values.dtype == np.float32
    assert (grid.name, grid.source) == ("density", "fog.vol")
    np.testing.assert_allclose(grid.values * np.array(found), values, rtol=TOLERANCE)
    assert max(found) == 1.0


def test_equal_channels_are_grey():
    values = coloured(np.ones(3))
    grid, found = reduced(values)
    assert found == (1.0,)
    np.testing.assert_array_equal(grid.values, values[..., :1])


def test_nothing_at_all_is_grey():
    grid, found = reduced(np.zeros((2, 3, 4, 3), np.float32))
    assert found == (1.0,)
    assert not grid.values.any()


def test_one_sample_of_another_colour_keeps_three_channels():
    for place in ((0, 0, 0), (8, 8, 8), (4, 4, 4)):
        values = coloured()
        values[place] = [0.2, 1.0, 0.7 * (1 + 4 * TOLERANCE)]
        assert reduced(values) is None
        values[place] = [0.2, 1.0, 0.7]
        assert reduced(values) is not None
        values[place] = [1e-30, 0.0, 0.0]  # where the reference is 0 everything must be
        assert reduced(values) is None


def test_slabs_agree_with_one_another(monkeypatch):
    monkeypatch.setattr("clvol.volumes.proportional.SLAB", 8 * 81)
    values = coloured()
    values[:3] = 0  # the colour is found beyond the first slabs
    grid, found = reduced(values)
    np.testing.assert_allclose(grid.values * np.array(found), values, rtol=TOLERANCE)
    values[-1, -1, -1] = [1, 1, 1]
    assert reduced(values) is None
