"""No noise among the samples is not no noise: what no sample met, or no sample can miss, is told apart."""

import math

import numpy as np
import pytest
from pictures import box, homogeneous, picture, volume

import clvol
from clvol.picture.result import unseen_noise
from clvol.rendering.adaptive import BLIND
from clvol.scene.records import ConstantEmitter, ConstVolume, Medium, PointEmitter

CUBE = (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)
SKY = (ConstantEmitter((1.0,)),)
SPP, PIXELS = 16, 16


def seen(medium, lights=SKY, target=(0, 0, 0)):
    return picture([box(*CUBE, medium)] if medium else [], lights, (0.0, 0.3, -4.0), target, 10.0)


def noise_of(scene, caplog, **choices):
    """Noise, and whether the log says that something has not been seen."""
    caplog.clear()
    result = clvol.render(scene, spp=SPP, seed=1, **choices)
    return result, "has not been seen" in caplog.text


def gridded(density, albedo=0.0):
    values = np.full((8, 8, 8), density, np.float32)
    return Medium(volume(values, *CUBE), ConstVolume((albedo,)), homogeneous=False)


@pytest.mark.parametrize("medium", [homogeneous(1e-9), gridded(1e-9)], ids=["analytic", "tracked"])
def test_a_medium_in_which_no_path_met_anything_leaves_a_bound(medium, caplog):
    result, said = noise_of(seen(medium), caplog)
    assert not result.variance.any()
    assert said and result.noise == pytest.approx(math.sqrt(3 / (SPP * PIXELS * SPP)), rel=1e-6)
    assert result.noise > 1e-9, "and bounds what is missing"


def test_more_samples_lower_the_bound_and_merge_into_it(caplog):
    scene = seen(homogeneous(1e-9))
    parts = [clvol.render(scene, samples=(first, SPP), seed=1) for first in (0, SPP)]
    merged = clvol.merge(parts)
    assert merged.noise == pytest.approx(unseen_noise(2 * SPP * PIXELS, 2 * SPP))
    assert merged.noise < parts[0].noise


def test_pictures_without_noise_have_none(caplog):
    sky, said = noise_of(seen(None), caplog)
    assert sky.noise == 0 and not said
    furnace, said = noise_of(seen(gridded(3.0, 1.0)), caplog, absorption="weight")
    assert furnace.noise < 1e-6 and not said
    beside, said = noise_of(seen(gridded(3.0), target=(0, 40, 0)), caplog)
    assert beside.noise == 0 and not said, "rays that pass the medium by"


def test_a_picture_that_is_black_by_chance_has_an_unknown_noise(caplog):
    lamp = PointEmitter((1.0,), (0.0, 50.0, 0.0))
    black, _ = noise_of(seen(gridded(1e-9, 0.5), (lamp,)), caplog)
    assert (black.image == 0).all() and math.isnan(black.noise)
    assert "its noise is unknown" in caplog.text


def test_a_target_error_is_not_met_by_seeing_nothing(caplog):
    """Light that one sample in a hundred or so finds: a first survey of 16 samples in one pixel does not."""
    lamp = PointEmitter((1.0,), (0.0, 50.0, 0.0))
    scene = picture([box(*CUBE, gridded(0.005, 0.5))], (lamp,), (0.0, 0.3, -4.0), (0, 0, 0), 10.0, (1, 1))
    result = clvol.render(scene, spp=4096, target_error=0.2, seed=3)
    assert result.image.max() > 0 and "saw no light" not in caplog.text
    dark = picture([box(*CUBE, gridded(1e-9))], (lamp,), (0.0, 0.3, -4.0), (0, 0, 0), 10.0, (1, 1))
    clvol.render(dark, target_error=0.2, seed=3)
    assert f"saw no light in {BLIND} samples" in caplog.text
