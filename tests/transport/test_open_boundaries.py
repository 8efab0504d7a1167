"""Media that open shapes bound: rooms of rectangles, a lake, a cup.

Rays see walls of radiance 1 through absorbing media, held to the exact transmittances: 1e-3 beside five
standard errors of each pixel.
"""

import logging
from dataclasses import replace

import numpy as np
import pytest
from pictures import box, camera_rays, homogeneous, picture
from stat_tests import assert_same_picture
from surface_scenes import icosphere

import clvol
from clvol import render
from clvol.scene.extents import openness
from clvol.scene.materials import Diffuse
from clvol.scene.records import ConstantEmitter, Shape

SIGMA, BLACK, EYE = 0.4, Diffuse((0.0,)), (0.2, 0.1, -5.0)
FOG = homogeneous(SIGMA)
SIDES = {  # rectangles whose normals point out of the cube of half edge 1
    "front": clvol.look_at((0, 0, -1), (0, 0, -2), (0, 1, 0)),
    "back": clvol.look_at((0, 0, 1), (0, 0, 2), (0, 1, 0)),
    "left": clvol.look_at((-1, 0, 0), (-2, 0, 0), (0, 1, 0)),
    "right": clvol.look_at((1, 0, 0), (2, 0, 0), (0, 1, 0)),
    "floor": clvol.look_at((0, -1, 0), (0, -2, 0), (0, 0, 1)),
    "ceiling": clvol.look_at((0, 1, 0), (0, 2, 0), (0, 0, 1)),
}


def side(name, **more):
    return Shape("rectangle", SIDES[name], name=name, **more)


def wall(name, **more):
    """An opaque wall with its normal inwards, which has the fog before it."""
    return side(name, exterior=FOG, bsdf=BLACK, flip_normals=True, **more)


def room(**back):
    others = [wall(name) for name in SIDES if name not in ("front", "back")]
    return [side("front", interior=FOG), wall("back", emission=(1.0,), **back), *others]


def seen(shapes, eye=EYE, fov=8.0, **more):
    return picture(shapes, [], eye, (0.0, 0.0, 1.0), fov, max_depth=4, **more)


def assert_shows(scene, lower, upper, bias=1e-3):
    """The wall's light through the fog, from the plane z = lower to z = upper."""
    _, d, w = camera_rays(scene)
    length = (upper - lower) / d[..., 2]
    expected = np.exp(-SIGMA * length) @ w
    result = render(scene, spp=1 << 12, seed=1)
    error = 5 * np.sqrt(result.variance[..., 0])
    assert (np.abs(result.image[..., 0] - expected) < error + bias).all() and error.max() < 0.05


def test_a_room_of_rectangles_is_filled(caplog):
    """As in Mitsuba: the fog is what light gets into by the front, whose own box holds nothing."""
    with caplog.at_level(logging.WARNING, logger="clvol"):
        assert_shows(seen(room()), -1.0, 1.0)
    assert "is open" not in caplog.text


@pytest.mark.parametrize("eye", [(0.3, 0.5, -4.0), (0.3, 0.5, -0.6)], ids=["outside", "inside"])
def test_a_room_scatters_as_a_box_does(eye):
    """Light that leaves it by one side comes back from the ground by another."""
    medium = homogeneous(2.0, 0.9)
    ground = clvol.translate((0, -1.3, 0)) @ clvol.rotate((1, 0, 0), -90) @ clvol.scale(4.0)
    white = Shape("rectangle", ground, bsdf=Diffuse((0.8,)))
    sides = [side(name, interior=medium) for name in SIDES]
    pictures = [
        picture([white, *shapes], [ConstantEmitter((1.0,))], eye, (0.0, -0.5, 0.0), 50.0, (8, 8))
        for shapes in (sides, [box((-1,) * 3, (1,) * 3, medium)])
    ]
    assert_same_picture(*(render(p, spp=1 << 13, seed=n) for n, p in enumerate(pictures)))


def test_a_lake_reaches_down_to_a_ground_that_does_not_name_it(caplog):
    surface = Shape("rectangle", clvol.look_at((0, 0, -1), (0, 0, -2), (0, 1, 0)) @ clvol.scale(9.0), FOG)
    ground = clvol.look_at((0, 0, 2), (0, 0, 0), (0, 1, 0)) @ clvol.scale(9.0)
    shapes = [surface, Shape("rectangle", ground, bsdf=BLACK, emission=(1.0,))]
    with caplog.at_level(logging.WARNING, logger="clvol"):
        assert_shows(seen(shapes), -1.0, 2.0)
    assert "rectangle is open" in caplog.text


def test_fog_in_a_cup_ends_at_its_rim():
    """Five sides of a cube: rays that leave by the sixth stay in the fog no longer than these go round it."""
    cup = [side(name, interior=FOG) for name in SIDES if name != "back"]
    behind = Shape("rectangle", clvol.translate((0, 0, 3)) @ clvol.rotate((0, 1, 0), 180) @ clvol.scale(9.0))
    shapes = [*cup, replace(behind, bsdf=BLACK, emission=(1.0,))]
    assert_shows(seen(shapes), -1.0, 1.0)


def test_meshes_with_holes_still_add_where_they_overlap():
    """Two balls, each without a triangle that no ray meets: rays pass the one, both, and the other."""
    balls = [icosphere((0, 0, z), 1.0, FOG, level=3) for z in (-0.4, 0.4)]
    for n, ball in enumerate(balls):
        sideways = ball.mesh.vertices[ball.mesh.faces].mean(axis=1)[:, 0].argmax()
        faces = np.delete(ball.mesh.faces, sideways, axis=0)
        balls[n] = replace(ball, mesh=replace(ball.mesh, faces=faces))
        assert 1e-4 < openness([balls[n]]) < 0.01
    behind = Shape("rectangle", clvol.translate((0, 0, 3)) @ clvol.rotate((0, 1, 0), 180) @ clvol.scale(9.0))
    scene = seen([*balls, replace(behind, bsdf=BLACK, emission=(1.0,))], eye=(0.0, 0.0, -5.0), fov=1.0)
    assert_shows(scene, -2.0, 2.0, bias=4e-3)  # polyhedra are a little smaller than balls


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_openness_is_that_of_the_surfaces_in_the_world(mirror):
    there = clvol.rotate((1, 2, 3), 40) @ clvol.scale((mirror * 2.0, 3.0, 0.5))
    moved = [Shape("rectangle", there @ SIDES[name]) for name in SIDES]
    areas = np.array([6.0, 6.0, 1.5 * 1.0, 1.5 * 1.0, 1.0 * 1.0, 1.0 * 1.0])
    assert openness(moved) == pytest.approx(0, abs=1e-6)
    assert openness(moved[:1]) == pytest.approx(1)
    assert openness(moved[1:]) == pytest.approx(areas[0] / areas[1:].sum())
    assert openness([Shape(kind, there) for kind in ("sphere", "cylinder", "cube")]) < 1e-6
    disk = Shape("disk", there)
    assert openness([disk]) == pytest.approx(1) and openness([disk], [disk]) == pytest.approx(0)
