"""Mixtures of BSDFs in pictures: closed forms, in one scene of a plate a pixel.

Light: the sky, of radiance 1/2, and a sun straight above that makes white diffuse plates 1 brighter.
"""

import numpy as np
import pytest
from pictures import assert_matches

from clvol import load_dict, render
from clvol.scene import look_at, scale, translate

SKY, SUN = 0.5, 1.0


def diffuse(reflectance):
    return {"type": "diffuse", "reflectance": reflectance}


def blend(first, second, weight):
    return {"type": "blendbsdf", "weight": weight, "first": first, "second": second}


def mask(nested, opacity):
    return {"type": "mask", "opacity": opacity, "nested": nested}


CHECKERS = {"type": "checkerboard", "color0": 0.25, "color1": 0.75}
NULL, MIRROR = {"type": "null"}, {"type": "conductor"}
HALF_GONE = blend(NULL, mask(diffuse(0.0), 0.5), 0.5)
LIT = SKY + SUN
PLATES = {
    "two paints": (blend(diffuse(0.2), diffuse(0.8), 0.25), 0.35 * LIT),
    "half there": (blend(NULL, diffuse(0.6), 0.5), 0.5 * SKY + 0.5 * 0.6 * LIT),
    "mirror and mask": (
        blend(MIRROR, mask(diffuse(0.4), 0.5), 0.5),
        0.5 * SKY + 0.25 * SKY + 0.25 * 0.4 * LIT,
    ),
    "by a texture": (blend(diffuse(0.0), diffuse(1.0), CHECKERS), 0.5 * LIT),
    "mixture of mixtures": (
        blend(
            blend(diffuse(0.1), diffuse(0.9), CHECKERS), {"type": "twosided", "inner": diffuse(0.3)}, CHECKERS
        ),
        # share and reflectance are textures of one phase: the mean of products
        LIT * np.mean([(1 - w) * ((1 - w) * 0.1 + w * 0.9) + w * 0.3 for w in (0.25, 0.75)]),
    ),
    "masks of textures": (
        mask(mask(diffuse(1.0), CHECKERS), CHECKERS),
        0.3125 * LIT + 0.6875 * SKY,
    ),
    "a mask round a mixture": (
        mask(blend(MIRROR, diffuse(0.4), 0.75), 0.5),
        0.5 * SKY + 0.125 * SKY + 0.375 * 0.4 * LIT,
    ),
    "in the shade of a mixture": (diffuse(1.0), 0.75 * 0.75 * LIT),
}


def scene(plates):
    size = len(plates)
    camera = {
        "type": "orthographic",
        "to_world": look_at([0, 5, 0], [0, 0, 0], [0, 0, 1]) @ scale([-size, size, 1]),
        "film": {"type": "hdrfilm", "width": size, "height": 1, "rfilter": {"type": "box"}},
    }
    lying = look_at([0, 0, 0], [0, 1, 0], [0, 0, 1])
    found = {
        "type": "scene",
        "sensor": camera,
        "sky": {"type": "constant", "radiance": SKY},
        "sun": {"type": "directional", "direction": [0, -1, 0], "irradiance": np.pi * SUN},
    }
    for n, bsdf in enumerate(plates):
        at = translate([2 * n - size + 1, 0, 0]) @ lying
        found[f"plate_{n}"] = {"type": "rectangle", "to_world": at, "bsdf": bsdf}
    above = translate([size - 1, 1e-3, 0]) @ lying
    found["shade"] = {"type": "rectangle", "to_world": above, "bsdf": HALF_GONE}
    return load_dict(found)


@pytest.fixture(scope="module")
def picture():
    return render(scene([bsdf for bsdf, _ in PLATES.values()]), spp=1 << 17, seed=3)


def test_mixtures_are_the_mean_of_what_they_mix(picture):
    expected = np.array([value for _, value in PLATES.values()])
    assert_matches(picture, expected[None, :, None])
