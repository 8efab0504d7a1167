"""The error that a picture tells of itself is the error that it has.

All pixels look along one ray, so that each is a render of the same number by numbers of its own; that number
is known (`clvol.lab.hard`).  Seeds are fixed, and each test raises a false alarm with probability 1e-4 or so.

Of sampler `joint` the variance is that of four parts which depend on each other, so that it is too large:
they make each other more even.  Here a flight and the walk of a shadow ray, of different blocks, decide
together: that the two pair their points differently (`part_in_turn` in cl/core/sobol.h) keeps it from being
too small.
"""

import functools

import numpy as np
import pytest
from scipy import stats
from stat_tests import largest_z
from tiers import quick_first

import clvol
from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.lab.hard.places import AHEAD, EYE, LUMPS

SIZE, SEEDS = 48, 3
BLOCK = Block(LUMPS, (1.0,), np.eye(4))
TRUTH = float(scenes.scattered([BLOCK], EYE, AHEAD)[0])


@functools.cache
def scene():
    made = scenes.sunlit([BLOCK], EYE, AHEAD, fov=1e-4)
    made["sensor"]["film"] |= {"width": SIZE, "height": SIZE}
    return clvol.load_dict(made)


@functools.cache
def pictures(sampler, spp):
    """Means and their variances, of pixels and seeds; first the most samples, whose kernels serve fewer."""
    if spp < 16:
        pictures(sampler, 16)
    results = [
        clvol.render(
            scene(), spp=spp, seed=90 + n, sampler=sampler, technique="regular", transmittance="ratio"
        )
        for n in range(SEEDS)
    ]
    return [
        np.stack([getattr(r, name)[..., 0] for r in results]).astype(float) for name in ("image", "variance")
    ]


def ratio_of_variances(sampler, spp):
    """Reported over scatter, and its standard error."""
    image, variance = pictures(sampler, spp)
    scatter = (image - TRUTH) ** 2
    error = [values.std() / values.mean() / np.sqrt(values.size) for values in (scatter, variance)]
    ratio = variance.mean() / scatter.mean()
    return ratio, ratio * np.hypot(*error)


@quick_first("spp", [2, 3, 5, 16])
@quick_first("sampler", ["independent", "sobol"], count=2)
def test_the_noise_is_the_scatter_over_seeds(sampler, spp):
    ratio, error = ratio_of_variances(sampler, spp)
    assert error < 0.03
    assert abs(ratio - 1) < largest_z(8) * error


@quick_first("spp", [2, 3, 5, 16, 64])
def test_the_noise_of_joint_samples_is_not_told_too_small(spp):
    ratio, error = ratio_of_variances("joint", spp)
    assert ratio - largest_z(5) * error > 1.2


def test_joint_samples_are_the_better_for_it():
    """Parts that pair flights and shadow rays alike have more variance than parts that do not know of it."""
    joint, apart = (np.mean((pictures(sampler, 16)[0] - TRUTH) ** 2) for sampler in ("joint", "sobol"))
    assert joint < 0.8 * apart


@pytest.mark.parametrize("sampler", ["independent", "sobol", "joint"])
def test_the_noise_of_one_sample_is_unknown(sampler):
    image, variance = pictures(sampler, 1)
    assert np.isinf(variance).all()
    assert abs(image.mean() - TRUTH) < largest_z(1) * image.std() / np.sqrt(image.size)


@pytest.mark.parametrize("sampler", ["independent", "sobol", "joint"])
@pytest.mark.parametrize("spp", [2, 5, 16])
def test_intervals_cover_as_often_as_they_say(sampler, spp):
    """Intervals of 95 % of means over 4 x 4 pixels, by Student's t of the pixels that a mean has."""
    image, variance = pictures(sampler, spp)
    tile = 4
    shape = SEEDS, SIZE // tile, tile, SIZE // tile, tile
    mean = image.reshape(shape).mean(axis=(2, 4))
    each = variance.reshape(shape).transpose(0, 1, 3, 2, 4).reshape(*mean.shape, -1)
    error = np.sqrt(each.sum(axis=-1)) / tile**2
    freedom = (
        each.sum(axis=-1) ** 2 / np.square(each).sum(axis=-1) * (3 if sampler != "independent" else spp - 1)
    )
    within = np.abs(mean - TRUTH) < stats.t.ppf(0.975, np.maximum(freedom, 1)) * error
    expected = 0.95
    spread = largest_z(9) * np.sqrt(expected * (1 - expected) / within.size)
    assert within.mean() > expected - spread
    if sampler != "joint":
        assert within.mean() < expected + spread + 0.01


@pytest.mark.parametrize("target", [0.2, 0.05])
def test_a_target_error_is_the_error(target):
    """`noise`, and the mean deviation from the truth, which for a normal one is 0.798 of it."""
    result = clvol.render(scene(), target_error=target, seed=4, technique="regular", transmittance="ratio")
    deviation = np.abs(result.image[..., 0].astype(float) / TRUTH - 1)
    assert result.noise < 1.1 * target
    assert deviation.mean() < 1.05 * np.sqrt(2 / np.pi) * result.noise
