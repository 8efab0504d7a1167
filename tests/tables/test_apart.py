"""Channels whose extinctions are a million times apart: each is shown, or the log says why not.

False alarms: 1e-4 for each comparison, at fixed seeds.
"""

import numpy as np
import pytest
from pictures import box, gridded, homogeneous, mean_and_error, picture, volume
from stat_tests import largest_z
from tiers import quick_first

import clvol
from clvol.planning.settled import FAR_APART
from clvol.scene.records import DirectionalEmitter
from clvol.tables.prepare import prepare

CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
ALBEDO, EDGE = 0.8, 2.0
PROFILE = np.array([0.2, 1.0, 0.1, 0.7, 0.5])


def lit(medium):
    sun = DirectionalEmitter((1.0,), (0.0, -1.0, 0.0))
    return picture([box(*CUBE, medium)], [sun], (0.1, 0.2, -900.0), (0.1, 0.2, 0.0), 1e-3, (2, 2))


def grid(depths):
    """Layers along the rays, of these optical depths; the three channels differ by the scale alone."""
    values = np.broadcast_to((PROFILE / PROFILE.mean())[:, None, None], (5, 3, 4))
    return gridded(volume(values, *CUBE), ALBEDO, scale=tuple(d / EDGE for d in depths))


def uniform(depths):
    return homogeneous([d / EDGE for d in depths], ALBEDO)


def once_scattered(depth):
    """What a channel so thin shows: isotropic single scattering of the sun."""
    return ALBEDO / (4 * np.pi) * depth


def assert_thin_channel(result, depth, error):
    """It is right, and known well enough to have been seen wrong."""
    mean, errors = mean_and_error(result)
    exact = once_scattered(depth)
    assert errors[2] < error * exact, f"too noisy to tell: {mean[2]} ± {errors[2]}, exact {exact}"
    bound = largest_z(1) * errors[2] + 0.01 * exact
    assert abs(mean[2] - exact) < bound, f"{mean[2]} ± {errors[2]}, not {exact}"


@quick_first("made", [uniform, grid])
def test_auto_shows_a_channel_a_million_times_thinner(made, caplog):
    depths = 1e3, 5e2, 1e-3
    result = clvol.render(lit(made(depths)), spp=1 << 15, seed=1)
    assert result.stats["paths"] == 3 * 4 << 15, "a path for each channel"
    assert_thin_channel(result, depths[2], error=0.2)
    assert "channels_apart" not in result.metadata and "differ by" not in caplog.text


def test_channels_that_one_path_serves_have_one(caplog):
    result = clvol.render(lit(uniform((10.0, 5.0, 10.0 / FAR_APART))), spp=16, seed=1)
    assert result.stats["paths"] == 4 * 16
    clvol.render(lit(grid((10.0, 5.0, 0.01))), spp=16, seed=1, technique="spectral")
    assert "differ by" not in caplog.text


@pytest.mark.parametrize("made", [uniform, grid])
@pytest.mark.parametrize("technique", ["spectral", "spectral-decomposition", "regular"])
def test_a_technique_that_is_asked_for_is_taken_with_a_warning(technique, made, caplog):
    result = clvol.render(lit(made((1e3, 5e2, 1e-3))), spp=4, seed=1, technique=technique)
    assert result.metadata["technique"] == (technique if made is grid else "analytic")
    assert result.metadata["channels_apart"] == "1 : 1e+06"
    assert "differ by 1 : 1e+06" in caplog.text and "a path for each channel" in caplog.text


@quick_first("technique", ["spectral", "spectral-decomposition", "regular"])
def test_the_guess_of_the_background_does_not_drown_a_thin_channel(technique):
    """Where the dense channels are thin enough to be seen through, one path does show all three."""
    depths = 10.0, 5.0, 1e-5
    result = clvol.render(lit(grid(depths)), spp=1 << 12, seed=2, technique=technique)
    assert_thin_channel(result, depths[2], error=0.3)


@pytest.mark.filterwarnings("error")
def test_the_mean_of_large_densities_does_not_overflow():
    """Of 64 densities of 1e38 the sum is beyond single precision, and their depth is not."""
    cube = volume(np.full((20, 20, 20), 1e38, np.float32), *CUBE)
    settled = prepare(lit(gridded(cube, ALBEDO, scale=1e-38))).plan.settled
    assert settled.depth == pytest.approx(EDGE, rel=0.05)
