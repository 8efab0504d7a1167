"""Every combination of majorant, absorption and transmittance has the same expectation in every pixel.

Each comparison looks at the image mean and at every tile; its false-alarm rate is 1e-4
(`assert_same_picture`) at fixed seeds, and a bias of 0.5 % of the image mean is rejected.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest
from pictures import ball, box, gridded, hg, picture, unit, volume
from stat_tests import assert_same_picture, image_mean

from clvol import render
from clvol.accel.bounds import with_slack
from clvol.scene.records import ConstantEmitter, DirectionalEmitter

CUBE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
SKY = (ConstantEmitter((0.6,)),)
TRAVEL = tuple(unit((0.5, -1.0, 0.4)))
SKY_AND_SUN = (*SKY, DirectionalEmitter((1.5,), TRAVEL))
SKY_AND_DARK_SUN = (*SKY, DirectionalEmitter((0.0,), TRAVEL))


def blobs(seed, size):
    """Flat-topped lumps in much empty space: look-ups on the plateaus meet their bound."""
    rng = np.random.default_rng(seed)
    z, y, x = (np.arange(size) + 0.5) / size * np.ones((3, 1))
    centres, radii = rng.uniform(0.2, 0.8, (12, 3)), rng.uniform(0.06, 0.16, 12)
    total = np.zeros((size, size, size))
    for (cx, cy, cz), radius in zip(centres, radii, strict=True):
        square = (z[:, None, None] - cz) ** 2 + (y[:, None] - cy) ** 2 + (x - cx) ** 2
        total += 2.5 * np.exp(-square / radius**2)
    return np.clip(total - 0.5, 0.0, 1.0)


@functools.cache
def cloud(lights):
    """A cloud in a cube and a small one in a ball, which lie beside each other."""
    main = gridded(volume(blobs(1, 32), *CUBE), 0.6, hg(0.5), scale=5.0)
    small = gridded(volume(blobs(2, 12), (1.0, 0.2, 0.3), (1.6, 0.8, 0.9)), 0.8, scale=8.0)
    shapes = box(*CUBE, main), ball((1.31, 0.5, 0.6), 0.29, small)
    return picture(shapes, lights, (0.8, 0.7, -1.6), (0.75, 0.5, 0.5), 42.0, (32, 32))


@functools.cache
def cloud_picture(lights, majorant="grid", absorption="mixed", transmittance="ratio", seed=0, spp=2048):
    return render(
        cloud(lights),
        spp=spp,
        seed=seed,
        majorant=majorant,
        absorption=absorption,
        transmittance=transmittance,
    )


def reference():
    return cloud_picture(SKY_AND_SUN, seed=1)


@pytest.mark.contract
@pytest.mark.parametrize("majorant", ["global", "kdtree"])
def test_global_majorants_and_kd_trees_show_the_picture_of_a_grid(majorant):
    other = cloud_picture(SKY_AND_SUN, majorant, seed=2)
    assert other.metadata["majorant"] == majorant
    assert reference().stats["majorant_violations"] == other.stats["majorant_violations"] == 0
    assert_same_picture(reference(), other)


@pytest.mark.contract
@pytest.mark.parametrize("absorption", ["sample", "weight"])
def test_absorption_by_event_and_by_weight_show_the_picture_of_the_mixture(absorption):
    other = cloud_picture(SKY_AND_SUN, absorption=absorption, seed=3)
    assert other.metadata["absorption"] == absorption
    assert_same_picture(reference(), other)


@pytest.mark.contract
def test_a_uniform_sky_is_the_same_with_and_without_light_sampling():
    sampled = cloud_picture(SKY_AND_DARK_SUN, transmittance="ratio", seed=4)
    found = cloud_picture(SKY, transmittance="none", seed=5)
    assert (sampled.metadata["transmittance"], found.metadata["transmittance"]) == ("ratio", "none")
    assert_same_picture(sampled, found)


def brightened(result, fraction, where=slice(None)):
    """The result with its image mean (or that of a part) off by a fraction, all of it in noisy pixels."""
    image = result.image.copy()
    noisy = result.variance[where] > 0
    image[where][noisy] += fraction * image[where].mean() / noisy.mean()
    return replace(result, image=image)


@pytest.mark.contract
@pytest.mark.parametrize("fraction", [-0.005, 0.005])
def test_a_bias_of_half_a_percent_is_rejected(fraction):
    """Planted in one picture of each kind of pair that is compared above."""
    for other in (
        cloud_picture(SKY_AND_SUN, "global", seed=2),
        cloud_picture(SKY_AND_SUN, "kdtree", seed=2),
        cloud_picture(SKY_AND_SUN, absorption="sample", seed=3),
        cloud_picture(SKY_AND_SUN, absorption="weight", seed=3),
    ):
        with pytest.raises(AssertionError, match="deviates"):
            assert_same_picture(reference(), brightened(other, fraction))


@pytest.mark.contract
def test_a_bias_of_one_tile_is_rejected():
    tile = slice(16, 24), slice(8, 16)
    biased = brightened(cloud_picture(SKY_AND_SUN, "kdtree", seed=2), 0.03, tile)
    with pytest.raises(AssertionError, match="a tile deviates"):
        assert_same_picture(reference(), biased)


@pytest.mark.contract
@pytest.mark.parametrize("majorant", ["global", "grid", "kdtree"])
def test_a_majorant_ten_percent_too_low_is_caught_by_count_and_by_picture(majorant, monkeypatch):
    reference()  # before anything is broken

    def lowered(minimum, maximum, cell_size, *others):
        bounds = with_slack(minimum, maximum, cell_size, *others)
        return replace(bounds, maximum=bounds.maximum * np.float32(0.9))

    monkeypatch.setattr("clvol.tables.majorants.with_slack", lowered)
    scene = cloud(SKY_AND_SUN)
    broken = render(scene, spp=2048, seed=6, majorant=majorant, transmittance="ratio", absorption="mixed")
    assert broken.stats["majorant_violations"] > 0.01 * broken.stats["lookups"]
    with pytest.raises(AssertionError, match="deviates"):
        assert_same_picture(reference(), broken)


@pytest.mark.contract
def test_the_image_mean_is_known_to_a_tenth_of_a_percent():
    mean, variance = image_mean(reference())
    assert (np.sqrt(variance) < 0.001 * mean).all()
