"""The integrator `depth`: its picture is the distance to the first surface, as in Mitsuba 3."""

import numpy as np
import pytest

import clvol

NEAR = 0.5
FILM = {"type": "hdrfilm", "width": 3, "height": 3, "rfilter": {"type": "box"}}
CAMERA = {
    "type": "orthographic",
    "near_clip": NEAR,
    "to_world": clvol.look_at((0, 0, 4), (0, 0, 0), (0, 1, 0)),
    "film": FILM,
}
FOG = {"type": "homogeneous", "sigma_t": 3.0, "emission_density": 1.0}
CUBE = {"type": "cube", "to_world": clvol.scale(2)}


def scene_of(integrator=None, **parts):
    integrator = integrator or {"type": "depth"}
    return clvol.load_dict({"type": "scene", "integrator": integrator, "sensor": CAMERA} | parts)


def picture(scene, **options):
    return clvol.render(scene, spp=4, seed=1, **options)


@pytest.mark.parametrize(
    "look",
    [
        {},
        {"bsdf": {"type": "null"}},
        {"bsdf": {"type": "null"}, "interior": FOG},
        {"bsdf": {"type": "mask", "opacity": 0.0, "inside": {"type": "diffuse"}}},
        {"bsdf": {"type": "dielectric"}, "interior": FOG},
        {"emitter": {"type": "area", "radiance": {"type": "rgb", "value": [5.0, 1, 0]}}},
        {"flip_normals": True},
    ],
    ids=["matt", "nothing", "fog", "holes", "glass", "lamp", "inside out"],
)
def test_every_surface_is_met_from_the_near_plane_on(look):
    result = picture(scene_of(box=CUBE | look, sky={"type": "constant"}))
    np.testing.assert_allclose(result.image, 2 - NEAR, rtol=1e-5)


def test_what_meets_nothing_is_0_and_needs_no_light(caplog):
    far = CUBE | {"to_world": clvol.translate((0, 3, 0))}
    assert picture(scene_of(box=far)).image.max() == 0
    assert not [record for record in caplog.records if "emitter" in record.getMessage()]


def test_the_cameras_medium_hides_nothing():
    scene = scene_of(sensor=CAMERA | {"medium": FOG}, box=CUBE)
    for view in (None, CAMERA | {"medium": FOG}):
        np.testing.assert_allclose(picture(scene, sensor=view).image, 2 - NEAR, rtol=1e-5)


def test_a_slanted_plane_has_the_distance_along_each_ray():
    """It is z = x: at x on a film that is 2 wide and mirrored."""
    plane = {"type": "rectangle", "to_world": clvol.rotate([0, 1, 0], -45) @ clvol.scale(3)}
    image = clvol.render(scene_of(plane=plane), spp=4096, seed=1).image[..., 0]
    np.testing.assert_allclose(image.mean(axis=0), 4 - NEAR - np.array([-2, 0, 2]) / 3, atol=0.02)


def test_it_may_be_inside_of_others_which_add_their_layers():
    inside = {"type": "depth"}
    assert picture(scene_of({"type": "moment", "a": inside}, box=CUBE)).image.max() > 0
    layers = {"type": "aov", "aovs": "n:sh_normal,c:albedo", "a": inside}
    red = {"bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.25, 0.125]}}}
    result = picture(scene_of(layers, box=CUBE | red))
    np.testing.assert_allclose(result.image, 2 - NEAR, rtol=1e-5)
    np.testing.assert_allclose(result.aovs["normal"], np.broadcast_to([0, 0, 1], (3, 3, 3)), atol=1e-6)
    np.testing.assert_allclose(
        result.aovs["albedo"], np.broadcast_to([0.5, 0.25, 0.125], (3, 3, 3)), rtol=1e-5
    )


def test_a_description_says_so_and_the_digest_tells_it_apart():
    from clvol.scene.describe import describe_scene

    scene, light = scene_of(box=CUBE), scene_of({"type": "path"}, box=CUBE)
    assert any("distance to the first surface" in line for line in describe_scene(scene))
    one, other = (picture(s).metadata["digest"] for s in (scene, light))
    assert one != other
