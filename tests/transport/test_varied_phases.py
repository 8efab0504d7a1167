"""Mixtures of phase functions whose weight is a volume: where that is 0 or 1 they are one, else both.

One row of pixels looks along a thin slab that is lit from the side; a pixel's phase function is its column's.
"""

import numpy as np
import pytest

from clvol import load_dict, render, traverse
from clvol.scene import look_at, scale, translate

WEIGHTS = np.array([0.0, 1.0, 0.25, 2.0])
"""Of the columns; Mitsuba cuts what is beyond 1."""
FIRST, SECOND = {"type": "hg", "g": 0.7}, {"type": "rayleigh"}


def column(phase):
    return {"type": "homogeneous", "sigma_t": 0.5, "albedo": 0.9, "phase": phase}


def slab(medium):
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
            "sun": {"type": "directional", "direction": [0.3, -0.8, 0.4]},
            "slab": cube,
        }
    )


def image(scene, seed):
    return render(scene, spp=1 << 17, seed=seed)


@pytest.fixture
def varied():
    data = WEIGHTS[None, None, :].repeat(2, 0).repeat(2, 1)
    volume = {"type": "gridvolume", "data": data, "filter_type": "nearest"}
    volume["to_world"] = translate([-4, -1, -1]) @ scale([8, 2, 2])
    return slab(column({"type": "blendphase", "weight": volume, "a": FIRST, "b": SECOND}))


@pytest.mark.parametrize("flipped", [False, True])
def test_each_column_has_its_mixture(varied, flipped):
    scene, weights = varied, np.minimum(WEIGHTS, 1)
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
