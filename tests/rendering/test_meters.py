"""Sensors of one pixel: radiancemeter and distant, with every target; and what they refuse."""

import numpy as np
import pytest

import clvol
from clvol.errors import Error
from clvol.planning.plan import Plan
from clvol.scene import load_dict
from clvol.scene.boundaries import scene_sphere
from clvol.scene.describe import describe_scene
from clvol.scene.views import seen_by
from clvol.tables.camera import camera_rays

PIXEL = {"type": "hdrfilm", "width": 1, "height": 1}
STEEP = (0.3, 0.2, -1.0)
FLOOR = {"type": "rectangle", "to_world": clvol.scale([3, 3, 1]), "emitter": {"type": "area"}}
MANY = 1 << 16


def scene_of(sensor, **more):
    return load_dict(
        {"type": "scene", "integrator": {"type": "path"}, "floor": FLOOR, "sensor": {"film": PIXEL} | sensor}
        | more
    )


def distant(**more):
    return {"type": "distant", "direction": STEEP, **more}


@pytest.fixture(scope="module")
def measured():
    """Means and standard errors; the scenes differ in the camera's record, and by lenses in code."""

    def of(scene):
        result = clvol.render(scene, spp=MANY, seed=3)
        return float(result.image[0, 0, 0]), float(np.sqrt(result.variance[0, 0, 0]))

    return of


def test_a_distant_sensor_without_a_target_sees_the_cross_section_of_the_scene(measured):
    """The floor, 6 by 6, as it is seen from there, over that of the sphere round it."""
    cosine = 1 / np.linalg.norm(STEEP)
    mean, error = measured(scene_of(distant()))
    assert mean == pytest.approx(36 * cosine / (18 * np.pi), abs=4 * error)
    assert error < 0.005 * mean


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ([1, 2, 0], 1.0),
        ([4, 2, 0], 0.0),
        ({"type": "rectangle", "to_world": clvol.translate([3, 0, 0])}, 0.5),
        ({"type": "disk", "to_world": clvol.translate([0, 3, 0]) @ clvol.scale([2, 0.5, 1])}, 0.5),
    ],
    ids=["point", "beside", "rectangle", "disk"],
)
def test_a_target_is_seen_and_nothing_else(measured, target, expected):
    mean, error = measured(scene_of(distant(target=target)))
    assert mean == pytest.approx(expected, abs=max(4 * error, 1e-6))


CUBE = {"type": "cube", "to_world": clvol.translate([2.7, 0.2, 1]) @ clvol.scale([0.3, 0.6, 0.2])}
CORNERS = np.array([(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3)], float)
SOLIDS = {
    "sphere": {"type": "sphere", "center": [3.1, 0, 1.0], "radius": 0.6},
    "cube": CUBE,
    "cylinder": {"type": "cylinder", "p0": [2.9, 0, 0.3], "p1": [2.6, 0.3, 1.5], "radius": 0.4},
    "mesh": {
        "type": "mesh",
        "vertex_positions": np.add(CORNERS, (2, 0, 0.5)),
        "faces": np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
    },
}


def points_of(name, n=400_000):
    """Points that lie evenly on a solid, float64 (n, 3)."""
    random = np.random.default_rng(5)
    given, (u, v) = SOLIDS[name], random.random((2, n))
    turn = np.stack([np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)], -1)
    if name == "sphere":
        z = 2 * u - 1
        return given["center"] + given["radius"] * np.c_[np.sqrt(1 - z * z)[:, None] * turn, z]
    if name == "cylinder":
        axis = np.subtract(given["p1"], given["p0"])
        across = np.cross(axis, (1, 0, 0)) / np.linalg.norm(np.cross(axis, (1, 0, 0)))
        other = np.cross(axis, across) / np.linalg.norm(axis)
        return given["p0"] + u[:, None] * axis + given["radius"] * turn @ np.array([across, other])
    if name == "mesh":
        corners = given["vertex_positions"][given["faces"]]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        a, b, c = np.moveaxis(corners[random.choice(4, n, p=areas / areas.sum())], 1, 0)
        root = np.sqrt(u)[:, None]
        return a + root * (1 - v[:, None]) * (b - a) + root * v[:, None] * (c - a)
    half = np.array([0.3, 0.6, 0.2])
    area = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]])
    axis = random.choice(3, n, p=area / area.sum())
    local = random.uniform(-1, 1, (n, 3))
    local[np.arange(n), axis] = np.where(random.random(n) < 0.5, -1.0, 1.0)
    return np.array([2.7, 0.2, 1]) + local * half


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_seen_all_over(measured, name):
    """The share of its points from which the way leads on, or came, through the floor."""
    p = points_of(name)
    x, y = (p[:, k] - p[:, 2] * STEEP[k] / STEEP[2] for k in range(2))
    inside = (np.abs(x) < 3) & (np.abs(y) < 3)
    expected, spread = inside.mean(), inside.std() / np.sqrt(len(p))
    mean, error = measured(scene_of(distant(target=SOLIDS[name])))
    assert 0.1 < expected < 0.9
    assert mean == pytest.approx(expected, abs=4 * np.hypot(error, spread))
    assert error < 0.005


def test_a_radiancemeter_sees_along_one_ray(measured):
    meter = {"type": "radiancemeter", "origin": [2.9, 0, 5], "direction": [0, 0, -2]}
    assert measured(scene_of(meter)) == (1.0, 0.0)
    beside = {"type": "radiancemeter", "to_world": clvol.look_at((3.1, 0, 5), (3.1, 0, 0), (0, 1, 0))}
    assert measured(scene_of(beside)) == (0.0, 0.0)


def test_distant_rays_start_outside_of_the_scene_however_far_its_middle_is():
    far = clvol.translate([1e3, 0, 0])
    scene = scene_of(distant(target=[1e3, 0, 0]), floor=FLOOR | {"to_world": far @ FLOOR["to_world"]})
    centre, radius = scene_sphere(scene, Plan.of(scene).boundaries)
    rays = camera_rays(scene.sensor, scene.film, centre, radius)
    assert np.linalg.norm(rays.position) == pytest.approx(2 * radius)
    np.testing.assert_allclose(rays.base, np.array(STEEP) / np.linalg.norm(STEEP))
    assert rays.far == np.inf


def test_to_world_wins_over_origin_and_direction_as_in_mitsuba():
    turned = clvol.translate([1, 2, 3])
    meter = {"type": "radiancemeter", "to_world": turned, "origin": [0, 0, 0], "direction": [1, 0, 0]}
    scene = scene_of(meter)
    assert np.array_equal(scene.sensor.to_world, turned)
    assert len(scene.approximated) == 2


def test_any_filter_serves_one_pixel():
    film = PIXEL | {"rfilter": {"type": "lanczos"}}
    assert scene_of(distant(film=film)).film.rfilter.kind == "box"


def test_they_are_described_and_have_parameters():
    words = "\n".join(describe_scene(scene_of(distant(target=[1, 2, 0]))))
    assert "from far away, towards (1, 2, 0)" in words
    scene = scene_of({"type": "radiancemeter"})
    assert "camera   radiance at (0, 0, 0) along (0, 0, 1)" in "\n".join(describe_scene(scene))
    assert {"sensor.to_world", "sensor.film.size"} <= set(clvol.traverse(scene))
    assert seen_by(scene, {"type": "perspective", "fov": 40}).film.width == 1


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (distant(film={"type": "hdrfilm", "width": 2, "height": 1}), "1 x 1 pixels, not 2 x 1"),
        ({"type": "radiancemeter", "film": {"type": "hdrfilm"}}, "1 x 1 pixels, not 768 x 576"),
        (
            {"type": "radiancemeter", "origin": [0, 0, 0]},
            "origin and direction of a radiancemeter go together",
        ),
        (distant(to_world=np.eye(4)), "either direction or to_world, not both"),
        (distant(direction=[0, 0, 0]), "direction is zero"),
        (
            distant(target={"type": "merge", "a": {"type": "cube"}}),
            "must be one shape, not a 'merge'",
        ),
        (
            distant(target={"type": "cylinder", "to_world": clvol.scale([1, 2, 1])}),
            "must not be stretched across",
        ),
        (distant(target="floor"), "'target' of sensor 'distant' must be three finite numbers"),
        (distant(fog={"type": "homogeneous"}), "starts outside of all shapes, and takes no medium"),
        ({"type": "radiancemeter", "to_world": clvol.scale(2)}, "must not scale or shear"),
    ],
    ids=lambda value: "",
)
def test_what_cannot_be_measured_is_an_error(sensor, message):
    with pytest.raises(Error, match=message):
        scene_of(sensor)
