"""A million samples in a pixel, the last samples that there are, paths of ten thousands of scatterings."""

from dataclasses import replace

import numpy as np
import pytest
from stat_tests import largest_z
from tiers import quick_first

import clvol
from clvol.lab.combinations import unbiased
from clvol.lab.hard import scenes
from clvol.lab.hard.block import Block
from clvol.scene.records import Integrator

EYE, AHEAD = (0.47, 0.52, -2.0), (0.0, 0.0, 1.0)
LUMPS = 0.2 + 0.8 * np.random.default_rng(4).random((9, 9, 9))
LAST = 2**32 - 1
"""Samples that a pixel may have."""


def one_pixel(scene):
    made = clvol.load_dict(scene)
    return replace(made, film=replace(made.film, width=1, height=1))


@pytest.mark.contract
@pytest.mark.parametrize("sampler", ["independent", "joint"])
def test_a_million_samples_of_a_pixel_do_not_drift(sampler):
    """As sums in float64, which are exact here."""
    sky = {"type": "constant", "radiance": 0.1}
    scene = one_pixel(scenes.view(np.array(EYE), np.array(AHEAD), {"sky": sky}))
    result = clvol.render(scene, spp=1 << 20, sampler=sampler)
    assert result.image[0, 0, 0] == np.float32(0.1)
    assert result.variance[0, 0, 0] < 1e-15


def test_the_last_samples_are_as_good_as_the_first():
    """Numbers beyond 2³¹, up to the last; and one more is refused."""
    block = Block(np.ones((4, 4, 4)), (1.0,), np.eye(4))
    scene = one_pixel(scenes.through([block], EYE, AHEAD, fov=1e-4))
    for first in (2**31 - 2048, LAST - 4096):
        result = clvol.render(scene, samples=(first, 4096), technique="delta")
        assert abs(result.image[0, 0, 0] - np.exp(-1)) < largest_z(2) * np.sqrt(result.variance[0, 0, 0])
        assert result.stats["non_finite"] == result.stats["walks_exhausted"] == 0
    with pytest.raises(clvol.Error, match=f"at most {LAST}"):
        clvol.render(scene, samples=(LAST - 4096, 4097))


@pytest.mark.parametrize("kind", ["grid", "homogeneous"])
@pytest.mark.parametrize(
    ("thickness", "scatterings"), [(250.0, 9e3), pytest.param(950.0, 9e4, marks=pytest.mark.hard_full)]
)
def test_a_path_of_many_scatterings_keeps_its_energy(kind, thickness, scatterings):
    """1e4 and 1e5, from the middle of a white cube; minutes, since few paths go through many waves.

    A walk of steps of one mean free path leaves a cube of T of them after 0.169 T² on average.
    """
    values = np.ones((4, 4, 4)) if kind == "grid" else np.array(1.0)
    block = Block(values, (thickness,), np.eye(4))
    scene = scenes.furnace([block], (0.5, 0.5, 0.5), AHEAD, albedo=1.0)
    made = replace(one_pixel(scene), integrator=Integrator())
    result = clvol.render(made, spp=16, technique="delta", transmittance="none")
    assert result.stats["real_collisions"] / result.stats["paths"] > scatterings
    assert result.image[0, 0, 0] == pytest.approx(1.0, abs=1e-6)
    assert result.stats["energy_lost_to_caps"] == result.stats["walks_exhausted"] == 0


@quick_first("technique", [name for name in unbiased("technique") if name != "delta"])
def test_ten_thousand_scatterings_keep_their_energy_by_any_technique(technique):
    """In a cube of lumps, where these have null collisions, controls and residuals, whose weights are 1."""
    block = Block(LUMPS, (400.0,), np.eye(4))
    scene = scenes.furnace([block], (0.5, 0.5, 0.5), AHEAD, albedo=1.0)
    made = replace(one_pixel(scene), integrator=Integrator())
    result = clvol.render(made, spp=16, technique=technique, transmittance="none")
    assert result.stats["real_collisions"] / result.stats["paths"] > 9e3
    assert result.image[0, 0, 0] == pytest.approx(1.0, abs=1e-6)
    assert result.stats["energy_lost_to_caps"] == result.stats["walks_exhausted"] == 0
    assert result.stats["majorant_violations"] == 0


@pytest.mark.parametrize("technique", ["spectral", "spectral-decomposition", "regular"])
def test_coloured_paths_of_many_scatterings_have_bounded_weights(technique):
    """One path for three channels of 3 : 2 : 1: their weights have a mean of 1, so that none exceeds 3."""
    block = Block(LUMPS, (300.0, 200.0, 100.0), np.eye(4))
    scene = scenes.furnace([block], (0.5, 0.5, 0.5), AHEAD, albedo=1.0)
    made = replace(one_pixel(scene), integrator=Integrator())
    result = clvol.render(made, spp=16, technique=technique, transmittance="none")
    print(
        result.image[0, 0],
        result.stats["largest_weight"],
        result.stats["real_collisions"] / result.stats["paths"],
    )
    assert result.image[0, 0].mean() == pytest.approx(1.0, abs=1e-4)
    assert result.stats["largest_weight"] < 3.001
    assert result.stats["energy_lost_to_caps"] == result.stats["walks_exhausted"] == 0
