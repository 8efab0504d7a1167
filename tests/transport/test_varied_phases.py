"""Mixtures of phase functions whose weight is a volume: where that is 0 or 1 they are one, else both.

One row of pixels looks along a thin slab that is lit from the side; a pixel's phase function is its column's.
"""

import numpy as np
import pytest

from clvol import load_dict, render, traverse
from clvol.scene import look_at, scale, translate

WEIGHTS = np.array([0.0, 1.0, 0.25, 2.0])
"""Of the columns; Mitsuba cuts what is beyond 1."""
SUN = {"type": "directional", "direction": [0.3, -0.8, 0.4]}
FIRST, SECOND = {"type": "hg", "g": 0.7}, {"type": "rayleigh"}


def column(phase):
    return {"type": "homogeneous", "sigma_t": 0.5, "albedo": 0.9, "phase": phase}


def slab(medium, light=None):
    camera = {
        "type": "orthographic",
        "to_world": look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]) @ scale([4, 4, 1]),
        "film": {"type": "hdrfilm", "width": 4, "height": 1, "rfilter": {"type": "box"}},
    }
    cube = {"type": "cube", "to_world": scale([4, 1, 1]), "bsdf": {"type": "null"}, "interior": medium}
    return load_dict(
        {
            "type": "scene",
            "sensor": camera,
            "integrator": {"type": "volpath", "max_depth": 2},
            "light": SUN if light is None else light,
            "slab": cube,
        }
    )


def image(scene, seed):
    return render(scene, spp=1 << 17, seed=seed)


def mixture():
    data = WEIGHTS[None, None, :].repeat(2, 0).repeat(2, 1)
    volume = {"type": "gridvolume", "data": data, "filter_type": "nearest"}
    volume["to_world"] = translate([-4, -1, -1]) @ scale([8, 2, 2])
    return column({"type": "blendphase", "weight": volume, "a": FIRST, "b": SECOND})


@pytest.mark.parametrize("flipped", [False, True])
def test_each_column_has_its_mixture(flipped):
    scene, weights = slab(mixture()), np.minimum(WEIGHTS, 1)
    if flipped:
        parameters = traverse(scene)
        name = "slab.interior_medium.phase_function.weight.data"
        parameters[name] = 1 - np.minimum(parameters[name], 1)
        parameters.update()
        weights = 1 - weights
    found = image(scene, 1)
    one, other = (image(slab(column(phase)), seed) for phase, seed in ((FIRST, 2), (SECOND, 3)))
    # the image's left is where x is least
    expected = (1 - weights)[:, None] * one.image[0] + weights[:, None] * other.image[0]
    error = np.sqrt(found.variance + one.variance + other.variance)[0]
    assert (error < 0.01 * expected).all() and (np.abs(found.image[0] - expected) < 4.5 * error).all()
    assert np.ptp(expected[:, 0]) > 0.2 * expected.mean()


@pytest.mark.contract
def test_directions_are_drawn_as_lights_are_weighed():
    """A sky with a bright spot, found by paths alone or sampled too: they differ where pdf and samples do."""
    sky = np.full((8, 16, 3), 0.1)
    sky[3:5, 2:5] = 5
    scene = slab(mixture(), {"type": "envmap", "bitmap": sky})
    found, sampled = (render(scene, spp=1 << 17, seed=4, transmittance=t) for t in ("none", "ratio"))
    error = np.sqrt(found.variance + sampled.variance)
    assert (error < 0.01 * sampled.image).all() and (np.abs(found.image - sampled.image) < 4.5 * error).all()


def test_a_medium_that_only_absorbs_may_have_one():
    """Then nothing of the mixture is compiled."""
    phase = {"type": "blendphase", "weight": {"type": "gridvolume", "data": np.eye(2)[None] * 0.5}}
    phase |= {"a": {"type": "hg"}, "b": {"type": "isotropic"}}
    fog = {"type": "homogeneous", "sigma_t": 0.7, "albedo": 0.0, "phase": phase}
    sensor = {
        "type": "orthographic",
        "to_world": look_at([0.1, 0.2, -3], [0.1, 0.2, 0], [0, 1, 0]) @ scale([0.1, 0.1, 1]),
        "film": {"type": "hdrfilm", "width": 2, "height": 2, "rfilter": {"type": "box"}},
    }
    parts = {"fog": {"type": "cube", "interior": fog, "bsdf": {"type": "null"}}, "sky": {"type": "constant"}}
    result = render(load_dict({"type": "scene", "sensor": sensor} | parts), spp=4096, seed=1)
    error = np.sqrt(result.variance.sum()) / result.image.size
    assert abs(result.image.mean() - np.exp(-1.4)) < 4.5 * error < 0.02
