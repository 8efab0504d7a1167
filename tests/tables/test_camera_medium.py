"""The medium that a sensor names: where it is then, and what is refused because it would be no picture."""

import functools
import logging
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from pictures import assert_matches, ball, box, homogeneous, picture
from places import CASES
from stat_tests import assert_same_picture
from surface_scenes import icosphere, mesh_box, meshed, solid_grid, surfaced
from tiers import quick_first

import clvol
from clvol.errors import SceneError
from clvol.scene.boundaries import find_boundaries
from clvol.scene.describe import describe_scene
from clvol.scene.digest import scene_digest
from clvol.scene.materials import Diffuse
from clvol.scene.records import ConstantEmitter, DirectionalEmitter, PointEmitter, Shape
from clvol.tables.camera_medium import starts_inside
from clvol.tables.prepare import prepare

CASE = CASES / "sensor_medium.xml"
LAMP = PointEmitter((10.0,), (0.0, 1.0, 2.0))
FLOOR = Shape("rectangle", np.eye(4), bsdf=Diffuse((0.5,)))
FOG = homogeneous(0.3, 0.5)


def in_fog(shapes=(), medium=FOG, lights=(LAMP,), eye=(0, 0, 4)):
    """A floor under a lamp, seen from `eye` by a sensor that names `medium`."""
    scene = picture([FLOOR, *shapes], lights, eye, (0, 0, 0), 45.0, (8, 8))
    return replace(scene, sensor=replace(scene.sensor, medium=medium))


@functools.cache
def around(seed=2):
    """The same fog, held by a sphere so large that what lies beyond adds less than e⁻⁶⁰."""
    return clvol.render(in_fog([ball((0, 0, 0), 200.0, FOG)], None), spp=1 << 10, seed=seed)


def assert_like_fog_around(*shapes, **more):
    result = clvol.render(in_fog(shapes, **more), spp=1 << 10, seed=1)
    assert_same_picture(result, around(), tile=4)


def test_the_file_is_seen_through_its_sensors_fog():
    """Mitsuba 3.9.1 (volpath, 24 x 24): 0.1905 with the fog, 0.0932 without."""
    result = clvol.render(clvol.load_file(CASE), spp=256, seed=1)
    assert result.image.mean() == pytest.approx(0.1905, rel=0.02)


def test_a_medium_that_only_the_sensor_names_is_everywhere():
    assert_like_fog_around()
    with pytest.raises(AssertionError):
        assert_same_picture(clvol.render(in_fog(medium=None), spp=1 << 10, seed=1), around(), tile=4)


@quick_first("holder", [ball((0, 0, 0), 200.0, FOG), icosphere((0, 0, 0), 200.0, FOG)], ids=["ball", "mesh"])
def test_it_counts_once_where_a_shape_holds_it_too(holder):
    assert_like_fog_around(holder)


def test_a_medium_on_both_sides_of_a_surface_is_everywhere():
    """Whether the sensor names it or not: the camera's media are found."""
    pane = Shape("sphere", np.diag([0.4, 0.4, 0.4, 1.0]), FOG, FOG)
    assert_like_fog_around(pane, medium=None)
    assert_like_fog_around(pane)


@pytest.mark.contract
def test_exteriors_keep_the_sensors_medium_out():
    """A clear bubble in the fog, as a picture of the same fog held by a sphere has it."""
    bubble = replace(ball((0, 0, 2.5), 0.4), exterior=FOG)
    named = clvol.render(in_fog([bubble]), spp=1 << 11, seed=1)
    held = clvol.render(in_fog([bubble, ball((0, 0, 0), 200.0, FOG)], None), spp=1 << 11, seed=2)
    assert_same_picture(named, held, tile=4)
    [entry] = find_boundaries(in_fog([bubble])).entries
    assert entry.everywhere


@quick_first("shapes", [(), (FLOOR,)], ids=["alone", "with a floor"])
def test_a_grid_is_bounded_by_its_box(shapes):
    """An absorbing grid before a sky of 1: a path of 2 through extinction 0.4, seen head-on."""
    scene = picture(list(shapes), (ConstantEmitter(),), (0.3, 0.2, -9), (0.3, 0.2, 0), 0.01, (2, 2))
    if shapes:
        scene = replace(scene, shapes=(replace(FLOOR, to_world=clvol.translate([50, 0, 0])),))
    grid = solid_grid(0.4, (-1, -1, -1), (1, 1, 1))
    scene = replace(scene, sensor=replace(scene.sensor, medium=grid))
    assert_matches(clvol.render(scene, spp=1 << 19, seed=3), np.exp(-0.8))


def test_light_alone_in_the_fog_is_single_scattering():
    """No shape at all: the picture of `around` without its floor."""
    scene = replace(in_fog(), shapes=())
    held = replace(scene, shapes=(ball((0, 0, 0), 200.0, FOG),), sensor=replace(scene.sensor, medium=None))
    one, other = (clvol.render(s, spp=1 << 10, seed=seed) for s, seed in ((scene, 1), (held, 2)))
    assert_same_picture(one, other, tile=4)


# -- what is refused -----------------------------------------------------------------------------------

HELD = [
    ball((0, 0, 0), 1.0, FOG),
    box((-1, -1, -1), (1, 1, 1), FOG),
    icosphere((0, 0, 0), 1.0, FOG),
    meshed(trimesh.creation.torus(5.0, 1.0), FOG),  # the camera is in its box, and in its hole
    surfaced(mesh_box((-1, -1, 3.5), (1, 1, 5), FOG), Diffuse((0.5,)), flip_normals=True),
]


@pytest.mark.parametrize("holder", HELD, ids=["ball", "box", "mesh", "torus", "inside out"])
def test_a_camera_outside_of_what_holds_its_medium_is_an_error(holder):
    scene = replace(in_fog([holder]), source="fog.xml")
    with pytest.raises(SceneError, match=r"fog.xml: the sensor names .* not inside of the shapes"):
        prepare(scene)


def test_a_camera_where_its_medium_is_kept_out_is_an_error():
    bubble = replace(ball((0, 0, 4), 0.5), exterior=FOG)
    with pytest.raises(SceneError, match="not inside"):
        prepare(in_fog([bubble]))


@pytest.mark.parametrize("light", [ConstantEmitter(), DirectionalEmitter((1.0,), (0, 0, -1))])
def test_light_from_infinity_through_endless_fog_is_an_error(light):
    """Mitsuba's picture depends on the integrator there (0.0751 and 0.0785 with a sky of 1 in this file)."""
    with pytest.raises(SceneError, match=r"gets through medium, which has no end: the sensor is in it"):
        prepare(in_fog(lights=(light,)))


def test_endless_exteriors_are_warned_of(caplog):
    bubble = replace(ball((0, 0, 2.5), 0.4), exterior=FOG)
    with caplog.at_level(logging.WARNING, logger="clvol"):
        prepare(in_fog([bubble], None, (ConstantEmitter(), LAMP)))
    assert "no light of 'constant' gets through medium, which has no end" in caplog.text


def test_a_sensor_takes_one_medium_and_path_none():
    sensor = {"type": "perspective", "fov": 40, "a": {"type": "homogeneous"}}
    with pytest.raises(SceneError, match="takes one medium, got 2"):
        clvol.load_dict({"type": "scene", "s": sensor | {"b": {"type": "homogeneous"}}})
    with pytest.raises(SceneError, match=r"'path' sees no media, and the scene has some \(sensor\)"):
        clvol.load_dict({"type": "scene", "s": sensor, "i": {"type": "path"}})


def test_the_camera_says_what_it_is_in():
    scene = clvol.load_file(CASE)
    assert scene.sensor.medium.name == "fog"
    assert "in homogeneous medium: sigma_t 0.3" in describe_scene(scene)[0]
    clear = replace(scene, sensor=replace(scene.sensor, medium=None))
    assert scene_digest(clear) != scene_digest(scene)


# -- geometry ------------------------------------------------------------------------------------------


def test_what_rays_start_inside_of():
    """Quadrics and meshes, moved and mirrored, against distances to their centres."""
    rng = np.random.default_rng(4)
    starts, towards = rng.uniform(-2, 2, (200, 3)), rng.normal(size=(200, 3))
    mirrored = clvol.translate([0.2, 0.1, 0.3]) @ clvol.rotate([1, 2, 3], 40) @ clvol.scale([-1.2, 1.2, 1.2])
    inside = np.linalg.norm(starts - [0.2, 0.1, 0.3], axis=1) < 1.2
    for shape in (Shape("sphere", mirrored), replace(icosphere(level=4), to_world=mirrored)):
        found = starts_inside([shape], starts, towards)
        assert (found == inside).mean() > 0.99  # a mesh of a ball is a little smaller
        turned = starts_inside([replace(shape, flip_normals=True)], starts, towards)
        assert not (turned & found).any() and turned.any()
    cube = starts_inside([Shape("cube", np.eye(4))], starts, towards)
    np.testing.assert_array_equal(cube, (np.abs(starts) < 1).all(axis=1))


def test_open_shapes_have_an_inside_where_rays_leave_by_their_front():
    starts, up = np.array([[0.1, 0.2, -1.0], [0.1, 0.2, 1.0], [3.0, 0.0, -1.0]]), np.array([[0, 0, 1.0]] * 3)
    for kind in ("rectangle", "disk"):
        shape = Shape(kind, np.eye(4))
        assert starts_inside([shape], starts, up).tolist() == [True, False, False]
        assert starts_inside([shape], starts, -up).tolist() == [False, False, False]
    aside = np.array([[1.0, 0.1, 0.01]] * 3)
    cylinder = Shape("cylinder", np.eye(4))
    assert starts_inside([cylinder], starts + np.array([0, 0, 1.3]), aside).tolist() == [True, False, False]
    assert starts_inside([cylinder], np.array([[0.1, 0.2, -5.0]]), np.array([[0.55, 0.0, 3.5]])).all()
