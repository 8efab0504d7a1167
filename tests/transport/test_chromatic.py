"""Chromatic media over grids: one channel per path, whatever mixture of grey and coloured volumes."""

from dataclasses import replace

import numpy as np
import pytest
from probe import grid_volume, medium_of, scene_of
from stat_tests import FALSE_ALARM, assert_same_picture, image_mean, largest_z, z_score

import clvol
from clvol.scene.records import ConstVolume

LUMPS = np.random.default_rng(0).random((12, 12, 12)).astype(np.float32)
SHARES = (1.0, 0.5, 0.1)


def channel_of(result, channel):
    mean, variance = image_mean(result)
    return mean[channel], variance[channel]


@pytest.mark.contract
def test_a_grey_volume_serves_every_channel_of_a_coloured_albedo():
    scene = scene_of(replace(medium_of(LUMPS, 4.0), albedo=ConstVolume((0.9, 0.6, 0.2))))
    sampled = clvol.render(scene, spp=4096, absorption="sample")  # follows one channel per path
    weighted = clvol.render(scene, spp=4096, seed=3, absorption="weight")  # carries all three
    assert_same_picture(sampled, weighted, tile=4)


def test_each_channel_of_a_coloured_grid_is_the_grey_render_of_that_channel():
    volume = grid_volume(np.stack([share * LUMPS for share in SHARES], axis=-1))
    coloured = clvol.render(scene_of(replace(medium_of(LUMPS, 4.0, 0.8), sigma_t=volume)), spp=8192)
    for channel, share in enumerate(SHARES):
        grey = clvol.render(scene_of(medium_of(LUMPS, 4.0 * share, 0.8)), spp=4096, seed=5)
        z = z_score(*channel_of(coloured, channel), *channel_of(grey, 0))
        assert abs(z) < largest_z(len(SHARES), FALSE_ALARM), f"channel {channel}"


def test_channels_that_are_mixed_up_are_noticed():
    volume = grid_volume(np.stack([share * LUMPS for share in SHARES], axis=-1))
    coloured = clvol.render(scene_of(replace(medium_of(LUMPS, 4.0, 0.8), sigma_t=volume)), spp=4096)
    grey = clvol.render(scene_of(medium_of(LUMPS, 4.0 * SHARES[1], 0.8)), spp=4096, seed=5)
    assert abs(z_score(*channel_of(coloured, 0), *channel_of(grey, 0))) > largest_z(1)
