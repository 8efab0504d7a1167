"""Parallel rays: Mitsuba's, whatever their transform; what is seen where; distances; media round the camera.

Numbers called Mitsuba's were printed by version 3.9.1 (scalar_rgb).
"""

import numpy as np
import pytest
from camera_paths import start_paths
from probe import medium_of, scene_of
from tiers import quick_first

import clvol
from clvol.errors import OptionError, SceneError
from clvol.rendering.labels import scenery_of
from clvol.scene import load_dict
from clvol.scene.describe import describe_scene
from clvol.scene.parameters import traverse
from clvol.scene.records import Film, Orthographic, ReconstructionFilter
from clvol.scene.views import seen_by
from clvol.tables.camera import camera_rays
from clvol.tables.prepare import prepare
from clvol.viewer.subject import Subject

SHEARED = np.array([[1.5, 0.2, 0.3, 1], [0.1, 2, -0.5, 2], [-0.4, 0.3, 1.2, 3], [0, 0, 0, 1]])
FILM = Film(6, 4, ReconstructionFilter("box", 0.5), crop=(1, 2, 4, 2))
CAMERA = Orthographic(SHEARED, near_clip=0.5, far_clip=50.0)
DIRECTION = (0.2248595059, -0.3747658134, 0.8994380832)
MITSUBAS_ORIGINS = {  # sensor.sample_ray: position in the crop window
    (0, 0): (2.1500000954, 1.8166666031, 3.3333332539),
    (1, 0): (0.1500001997, 1.6833333969, 3.8666665554),
    (0.25, 0.75): (1.5499999523, 0.7833334208, 3.3166666031),
}


@pytest.mark.parametrize("place", MITSUBAS_ORIGINS)
def test_rays_are_mitsubas(place):
    rays = camera_rays(CAMERA, FILM, np.zeros(3), radius=1e3)
    origin = rays.position + place[0] * 4 * rays.dx + place[1] * 2 * rays.dy
    np.testing.assert_allclose(origin, MITSUBAS_ORIGINS[place], atol=1e-6)
    np.testing.assert_allclose(rays.base, DIRECTION, atol=1e-7)
    assert rays.far == 49.5


def test_far_from_the_scene_rays_start_before_it_and_end_where_they_would():
    centre = np.array([40.0, -60.0, 150.0])
    near = camera_rays(CAMERA, FILM, np.zeros(3), radius=1e3)
    far = camera_rays(CAMERA, FILM, centre, radius=2.0)
    advanced = far.position + centre - near.position
    ahead = advanced @ far.base
    assert ahead > 50
    np.testing.assert_allclose(advanced, ahead * far.base, atol=1e-12)
    assert near.far - far.far == pytest.approx(ahead)


def test_points_are_placed_where_their_rays_start():
    rays = camera_rays(CAMERA, FILM, np.zeros(3), radius=1e3)
    point = rays.position + 3.25 * rays.dx - 0.5 * rays.dy + 7 * rays.base
    np.testing.assert_allclose(rays.place(point[None])[:, 0], (3.25, -0.5, 7))
    perspective = clvol.load_dict({"type": "scene", "c": {"type": "perspective", "fov": 40}}).sensor
    rays = camera_rays(perspective, FILM, np.zeros(3), radius=1e3)
    point = rays.eye + 3 * (rays.base + 3.25 * rays.base_dx - 0.5 * rays.base_dy)
    np.testing.assert_allclose(rays.place(point[None])[:, 0], (3.25, -0.5, 3))


def test_the_device_starts_these_rays(device):
    scene = scene_of(medium_of(1.0, albedo=0.5))
    scene = clvol.scene.views.replace(scene, sensor=CAMERA, film=FILM)
    started = start_paths(device, scene, 8)
    np.testing.assert_allclose(started.direction, np.tile(DIRECTION, (64, 1)), atol=1e-6)
    rays = camera_rays(CAMERA, FILM, np.zeros(3), radius=1e3)
    x, y, _ = rays.place(started.origin)
    assert np.array_equal(np.floor(x + 1e-4 * (x % 1 < 0.5)), started.pixel % 4)
    assert np.array_equal(np.floor(y + 1e-4 * (y % 1 < 0.5)), started.pixel // 4)


def scene_dict(**more):
    """A step of two squares, 3 and 5 before a camera whose film is 4 x 2."""
    film = {"type": "hdrfilm", "width": 4, "height": 2, "rfilter": {"type": "box"}}
    place = clvol.look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)) @ clvol.scale([2, 2, 1])
    left = clvol.translate([-1, 0, 2])
    return {
        "type": "scene",
        "camera": {"type": "orthographic", "to_world": place, "film": film},
        "left": {"type": "rectangle", "to_world": left, "light": {"type": "area", "radiance": 2.0}},
        "right": {"type": "rectangle", "to_world": clvol.translate([1, 0, 0])},
    } | more


def test_depth_is_the_distance_from_the_cameras_plane():
    result = clvol.render(load_dict(scene_dict()), spp=4, seed=1, aov=("depth", "position"))
    np.testing.assert_allclose(result.aovs["depth"], [[3, 3, 5, 5]] * 2, rtol=1e-6)
    assert (result.image[:, :2] == 2).all()
    assert (np.diff(result.aovs["position"][0, :, 0]) > 0).all()  # to the right in the picture: +x


def test_parameters_sizes_and_words():
    scene = load_dict(scene_dict())
    found = traverse(scene)
    assert {name for name in found if name.startswith("camera.")} >= {"camera.to_world", "camera.near_clip"}
    assert "camera.x_fov" not in found
    found["camera.to_world"] = clvol.look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)) @ clvol.scale([1, 1, 1])
    found.update()
    assert clvol.render(scene, spp=4, seed=1, aov=("depth",), size=(2, 1)).aovs["depth"].tolist() == [[3, 5]]
    assert any("orthographic at (0, 0, 5), 2 wide" in line for line in describe_scene(scene))
    with pytest.raises(SceneError, match="must be beyond"):
        found.update({"camera.far_clip": 1e-3})
    with pytest.raises(OptionError, match="moves perspective cameras"):
        Subject(scene)
    assert isinstance(seen_by(scene, {"type": "orthographic"}).sensor, Orthographic)


@quick_first("start", [0.0, 8.0])
def test_a_camera_inside_a_medium_starts_in_it(start):
    """Absorption along parallel rays is exp(-length), also where they start within the boundary."""
    place = clvol.look_at((0, 0, start), (0, 0, -20), (0, 1, 0)) @ clvol.scale([1e-3, 1e-3, 1])
    tube = {
        "type": "cylinder",
        "p0": [0, -4, 0],
        "p1": [0, 4, 0],
        "radius": 2.0,
        "bsdf": {"type": "null"},
        "interior": {"type": "homogeneous", "albedo": 0.0, "sigma_t": 0.1},
    }
    film = {"type": "hdrfilm", "width": 2, "height": 1, "rfilter": {"type": "box"}}
    camera = {"type": "orthographic", "to_world": place, "film": film, "near_clip": 1e-4}
    scene = {"type": "scene", "camera": camera, "tube": tube, "sky": {"type": "constant"}}
    result = clvol.render(load_dict(scene), spp=32768, seed=3)
    expected, error = np.exp(-0.1 * min(4, 2 + start)), np.sqrt(result.variance.mean() / 2)
    assert error < 0.003 * expected
    assert abs(result.image.mean() - expected) < 4 * error


def test_labels_and_rays_know_where_a_volume_is():
    box = {
        "type": "cube",
        "bsdf": {"type": "null"},
        "interior": {"type": "heterogeneous", "sigma_t": {"type": "gridvolume", "data": np.ones((2, 2, 2))}},
    }
    scene = load_dict(
        scene_dict(left=box, right={"type": "rectangle", "to_world": clvol.translate([0, 0, -9])})
    )
    prepared = prepare(scene, {})
    scenery = scenery_of(prepared)
    np.testing.assert_allclose(scenery.project(np.array([(0, 0, 0), (2, 1, 1)])), [(2, 1), (4, 0)], atol=1e-9)
    place = clvol.trace_ray(scene, 2, 0, seed=1).place
    assert place.length == pytest.approx(1)
    assert place.distance == pytest.approx(4)
