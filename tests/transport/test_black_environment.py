"""An environment map of radiance zero: black and finite, and no light beside it is lost."""

import numpy as np
import pytest
from pictures import assert_matches, camera_rays, picture

from clvol import render
from clvol.scene.materials import Diffuse
from clvol.scene.records import EnvmapEmitter, PointEmitter, Shape

PLACE = np.array([0.2, 1.2, 1.3])


@pytest.mark.parametrize("intensity", [0.0, 3.0], ids=["alone", "beside a lamp"])
def test_an_environment_map_of_zero_is_black(intensity):
    """A floor in it shows what a point light gives, 0.6 / pi I cos / d²; it is black in Mitsuba 3.9.1 too."""
    floor = Shape("rectangle", np.diag([9.0, 9.0, 1.0, 1.0]), bsdf=Diffuse((0.6,)))
    lights = [
        EnvmapEmitter(np.zeros((4, 8, 3), np.float32), np.eye(4)),
        PointEmitter((intensity,), tuple(PLACE)),
    ]
    scene = picture([floor], lights, (0.1, 0.2, 4.0), (0.1, 0.2, 0.0), 10.0)
    result = render(scene, spp=1 << 10, seed=1)
    assert result.stats["non_finite"] == 0
    if not intensity:
        assert (result.image == 0).all()
        return
    o, d, w = camera_rays(scene)
    points = o - (o[2] / d[..., 2])[..., None] * d
    to = PLACE - points
    square = (to**2).sum(-1)
    answer = (0.6 / np.pi * intensity * to[..., 2] / square**1.5) @ w
    assert_matches(result, answer[..., None])
