"""Large surfaces that pass near the scene's centre: a ray that leaves one does not meet it again.

Coordinates are small there, and what they were computed from is not.
"""

import numpy as np
import pytest
from pictures import picture, unit
from surface_scenes import SKY

import clvol
from clvol.scene.materials import Diffuse
from clvol.scene.records import Shape

HALF, BLACK = Diffuse((0.5,)), Diffuse((0.0,))
NORMALS = {"level": unit((0.0, 0.0, 1.0)), "slanted": unit((0.3, 0.5, 0.7)), "steep": unit((0.2, -0.9, 0.4))}


def large(kind, size, normal):
    """A shape through the origin, where it has that normal."""
    turned = clvol.look_at((0, 0, 0), tuple(normal), (0.6, 0.1, 0.2)) @ clvol.rotate((0, 0, 1), 25.0)
    depth = size if kind in ("sphere", "cylinder") else 0.0
    local = clvol.translate((0, 0, -depth)) @ clvol.scale(size)
    if kind == "cylinder":
        local = local @ clvol.rotate((1, 0, 0), 90.0) @ clvol.scale((1, 1, 4)) @ clvol.translate((0, 0, -0.5))
    return Shape(kind, turned @ local, bsdf=HALF)


def corners(size):
    """Specks that make the origin the scene's centre, and one set of kernels serve all kinds."""
    places = [clvol.translate((4 * sign * size,) * 3) @ clvol.scale(1e-3 * size) for sign in (-1, 1)]
    return [Shape(kind, place, bsdf=BLACK) for kind in ("rectangle", "sphere") for place in places]


@pytest.mark.parametrize("normal", NORMALS)
@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere", "cylinder"])
def test_a_large_surface_does_not_hide_the_sky_from_itself(kind, normal):
    """One half of a uniform sky, from every sample."""
    n = NORMALS[normal]
    for size in (10.0, 1e3, 1e5):
        eye = 3 * n + unit(np.cross(n, (0.3, 0.5, 0.1)))
        shapes = [large(kind, size, n), *corners(size)]
        scene = picture(shapes, [SKY], eye, (0, 0, 0), 20.0, (8, 8), (0.1, 0.9, 0.3), max_depth=2)
        image = clvol.render(scene, spp=64, seed=3).image
        assert abs(image - 0.5).max() < 1e-3
