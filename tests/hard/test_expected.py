"""What the hard cases expect is right where it is a formula: by adding and doubling, and by tables."""

import numpy as np
import pytest

from clvol.lab.combinations import unbiased
from clvol.lab.hard import scenes, splits, white

NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)
MU = np.concatenate([(NODES + 1) / 2, [scenes.SUN[2], 1.0]])
FLUX = np.diag(2 * MU * np.concatenate([WEIGHTS / 2, [0, 0]]))
"""Cosines, the last two of which are the sun's and the viewer's, and what integrates over them."""


def doubled(depth, halvings):
    """Reflection and diffuse transmission of a white isotropic slab, by Hansen and Travis 1974."""
    layer = depth / 2**halvings
    direct = np.diag(np.exp(-layer / MU))
    total, difference = 1 / MU[:, None] + 1 / MU, 1 / MU[:, None] - 1 / MU
    product = 4 * MU[:, None] * MU
    reflected = -np.expm1(-layer * total) / (total * product)
    near = np.abs(difference) < 1e-12
    ratio = np.where(near, layer, -np.expm1(-layer * difference) / np.where(near, 1, difference))
    passed = np.exp(-layer / MU) * ratio / product
    lost = -np.expm1(-layer / MU) / (np.diag(FLUX) @ (reflected + passed))  # to second scatterings in a layer
    reflected, passed = lost * reflected, lost * passed
    for _ in range(halvings):
        bounced = np.linalg.solve(np.eye(len(MU)) - reflected @ FLUX @ reflected @ FLUX, np.eye(len(MU)))
        bounced = bounced @ reflected @ FLUX @ reflected  # twice and more often between the layers
        down = passed + bounced @ direct + bounced @ FLUX @ passed
        up = reflected @ direct + reflected @ FLUX @ down
        reflected = reflected + direct @ up + passed @ FLUX @ up
        passed = direct @ down + passed @ direct + passed @ FLUX @ down
        direct = direct @ direct
    return reflected, passed


def test_doubling_has_what_van_de_hulst_published():
    """Albedo 1, thickness 1, normal incidence: R and, with what is not scattered, T."""
    reflected, passed = doubled(1.0, 24)
    flux = np.diag(FLUX)
    assert flux @ reflected[:, -1] == pytest.approx(0.34133, abs=1e-5)
    assert flux @ passed[:, -1] + np.exp(-1) == pytest.approx(0.65867, abs=1e-5)


@pytest.mark.parametrize("depth", [20.0, 100.0, 1000.0])
def test_white_slabs_show_what_doubling_says(depth):
    for through, table in zip((False, True), doubled(depth, 30), strict=True):
        seen = 4 * scenes.SUN[2] * table[-1, -2]
        assert white.slab_radiance(depth, through) == pytest.approx(seen, rel=1e-4)


def test_h_and_the_extrapolation_length_are_the_published_ones():
    assert white.h_function(1.0) == pytest.approx(2.907811, abs=1e-6)
    assert white.h_function(0.5) == pytest.approx(2.01278, abs=1e-5)
    assert white.extrapolation_length() == pytest.approx(0.71044609, abs=1e-8)


@pytest.mark.parametrize("side", [24, 32])
def test_rays_in_splits_are_in_planes_of_every_tree(side):
    """Each technique has a tree of its own."""
    block = splits.lumps(side)
    for o, d in (splits.in_split(block), splits.in_two_splits(block)):
        planes = {splits.Split(axis, o[axis]) for axis in range(3) if d[axis] == 0}
        assert planes
        for technique in set(unbiased("technique")) - {"regular"}:
            assert planes <= set(splits.splits(block, technique)), technique
