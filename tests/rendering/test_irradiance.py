"""Sensor irradiancemeter: on every kind of shape, against closed forms; and what it refuses."""

import numpy as np
import pytest
from scipy.special import expn
from tiers import quick_first

import clvol
from clvol.errors import Error
from clvol.scene import load_dict
from clvol.scene.describe import describe_scene
from clvol.scene.views import seen_by

PIXEL = {"type": "hdrfilm", "width": 1, "height": 1}
METER = {"type": "irradiancemeter", "film": PIXEL}
SKY = {"type": "constant"}
UPPER = np.repeat(np.float32([1.0, 0.0]), 256)[:, None, None] * np.ones((1, 4, 3), np.float32)
HALF_SKY = {"type": "envmap", "bitmap": UPPER, "to_world": clvol.rotate([1, 0, 0], 90)}
TETRAHEDRON = {
    "type": "mesh",
    "face_normals": True,
    "vertex_positions": np.array([(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3)], float),
    "faces": np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
}
MIRRORED = clvol.scale([-1, 1, 1])


def scene_of(shape, meter=METER, **more):
    given = {"type": "scene", "integrator": {"type": "path"}, "sky": SKY}
    return load_dict(given | {"plate": shape | {"meter": meter}} | more)


def measured(scene, spp=1 << 16):
    """Mean and standard error of the irradiance over pi."""
    result = clvol.render(scene, spp=spp, seed=3)
    return float(result.image.mean()) / np.pi, float(np.sqrt(result.variance[0, 0, 0])) / np.pi


SHAPES = {
    "rectangle": {"type": "rectangle"},
    "ellipse": {"type": "disk", "to_world": clvol.rotate([1, 2, 3], 40) @ clvol.scale([1, 3, 1])},
    "sphere": {"type": "sphere", "center": [1e3, 0, 0], "radius": 2.0},
    "cube": {"type": "cube", "to_world": clvol.scale([1, 2, 3])},
    "mesh": TETRAHEDRON,
    "cylinder": {"type": "cylinder"},
    "mirrored": TETRAHEDRON | {"to_world": MIRRORED},
}


@pytest.mark.parametrize("name", SHAPES)
def test_under_an_even_sky_it_is_pi_on_whatever_is_convex(name):
    """No ray meets the shape that it starts on: not one of 4096 is lost."""
    mean, error = measured(scene_of(SHAPES[name]), 4096)
    assert mean == pytest.approx(1.0, abs=1e-6) and error < 1e-7


def of_tetrahedron():
    """Mean of (1 + cos) / 2 over its faces, of the angles of their normals with z."""
    corners = TETRAHEDRON["vertex_positions"][TETRAHEDRON["faces"]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    return float((areas + normals[:, 2]).sum() / areas.sum() / 2)


@quick_first(
    ("name", "shape", "expected"),
    [
        ("upright", {"type": "disk", "to_world": clvol.rotate([1, 0, 0], 90)}, 0.5),
        ("mesh", TETRAHEDRON, of_tetrahedron()),
        ("rectangle", {"type": "rectangle"}, 1.0),
        ("downwards", {"type": "rectangle", "flip_normals": True}, 0.0),
        ("mirrored", {"type": "rectangle", "to_world": MIRRORED}, 1.0),
        ("slanted", {"type": "disk", "to_world": clvol.rotate([1, 0, 0], 60)}, 0.75),
        ("sphere", {"type": "sphere", "radius": 3.0}, 0.5),
        ("cylinder", {"type": "cylinder"}, 0.5),
        ("cube", {"type": "cube", "to_world": clvol.scale([2, 1, 0.5])}, (8 * 0.5 + 6 * 0.5) / 14),
    ],
    count=2,
)
def test_under_half_a_sky_it_is_by_the_angle_of_the_normals(name, shape, expected):
    """Of a plane at an angle a: (1 + cos a) / 2."""
    mean, error = measured(scene_of(shape, sky=HALF_SKY))
    assert error < 0.003
    assert mean == pytest.approx(expected, abs=4 * error + 1e-6)


def test_the_last_columns_of_a_wide_film_see_all_of_a_mesh():
    """Of three triangles a small one is lit; a place in column 65535 leaves eight digits to the pixel."""
    small = np.sqrt(0.0008)
    corners = np.array([(0, 0, 0), (small, 0, 0), (0, small, 0), (1, 0, 0), (0, 1, 0)])
    faces = np.array([(0, 2, 1), (0, 1, 2), (0, 4, 3)])
    plate = {"type": "mesh", "face_normals": True, "vertex_positions": corners, "faces": faces}
    film = {"type": "hdrfilm", "width": 65536, "height": 1}
    scene = scene_of(plate, METER | {"film": film}, sky=HALF_SKY, integrator={"type": "path"})
    result = clvol.render(scene, spp=64, seed=3)
    found = result.image[0, 40000:].mean() / np.pi
    lit = 0.0008 / 1.0016
    assert found == pytest.approx(lit, abs=4 * np.sqrt(lit / (64 * 25536)))


def test_a_square_that_faces_a_square_has_its_form_factor():
    """Howell's catalogue, C-11: equal parallel squares at a distance of their side."""
    lamp = {"type": "rectangle", "to_world": clvol.translate([0, 0, 2]) @ clvol.rotate([1, 0, 0], 180)}
    dark = {"type": "point", "intensity": 0.0}
    scene = scene_of({"type": "rectangle"}, sky=dark, lamp=lamp | {"light": {"type": "area"}})
    a = np.sqrt(2)
    factor = 2 / np.pi * (np.log(np.sqrt(4 / 3)) + 2 * a * np.arctan(1 / a) - 2 * np.arctan(1.0))
    mean, error = measured(scene, 1 << 21)
    assert factor == pytest.approx(0.19982, abs=1e-5)
    assert error < 0.005 / 3 * factor
    assert mean == pytest.approx(factor, abs=4 * error)


@pytest.mark.parametrize("inside", [False, True])
def test_fog_over_a_plate_lets_its_exponential_integral_through(inside):
    """An absorbing layer of optical thickness t before an even sky: 2 E3(t), where the plate is in it too."""
    up = 0.0 if inside else 0.8
    layer = clvol.translate([0, 0, up]) @ clvol.scale([1e4, 1e4, 0.5])
    medium = {"type": "homogeneous", "sigma_t": 0.9 if inside else 0.7, "albedo": 0.0}
    fog = {"type": "cube", "to_world": layer, "bsdf": {"type": "null"}, "interior": medium}
    volpath = {"type": "volpath"}
    mean, error = measured(scene_of({"type": "rectangle"}, fog=fog, integrator=volpath), 1 << 20)
    expected = 2 * expn(3, 0.9 * 0.5 if inside else 0.7)
    assert error < 0.005 / 3 * expected
    assert mean == pytest.approx(expected, abs=4 * error)


def test_every_pixel_of_a_larger_film_has_the_same_mean():
    film = PIXEL | {"width": 3, "height": 2, "rfilter": {"type": "gaussian"}}
    result = clvol.render(scene_of({"type": "rectangle"}, METER | {"film": film}), spp=16)
    assert result.image == pytest.approx(np.full((2, 3, 3), np.pi), rel=1e-6)


def test_it_is_one_of_the_sensors_in_the_order_of_the_scene():
    camera = {"type": "perspective"}
    scene = scene_of({"type": "rectangle"}, after=camera)
    assert [sensor.name for sensor in scene.sensors] == ["plate.meter", "after"]
    assert "camera   irradiance of the rectangle 'plate'" in "\n".join(describe_scene(scene))
    parameters = clvol.traverse(scene)
    assert "plate.meter.film.size" in parameters and "plate.meter.to_world" not in parameters
    parameters.update({"plate.to_world": clvol.rotate([1, 0, 0], 90)})
    assert scene.sensor.shape is scene.shapes[0]
    assert scene.sensor.to_world[1, 2] == pytest.approx(-1)
    assert seen_by(scene, 1).film.width == 768


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"plate": {"type": "rectangle"}, "meter": METER}, "outside a shape measures nothing; put it into"),
        (
            {"plate": {"type": "rectangle", "m": METER | {"to_world": MIRRORED}}},
            "has the to_world of",
        ),
        (
            {"plate": {"type": "rectangle", "m": {"type": "perspective"}}},
            "takes no sensor 'perspective'",
        ),
        ({"plate": {"type": "rectangle", "m": METER | {"near_clip": 1.0}}}, "near_clip"),
        ({"all": {"type": "merge", "plate": {"type": "cube", "m": METER}}}, "a shape in a merge takes no"),
        ({"all": {"type": "batch", "m": METER}}, "of a batch stands in a shape; put it into the shape whose"),
        ({"all": {"type": "batch", "m": {"type": "sphere"}}}, "needs an irradiancemeter inside"),
        (
            {"rod": {"type": "cylinder", "to_world": clvol.scale([1, 2, 1]), "m": METER}},
            "must not be stretched across",
        ),
        (
            {
                "ball": TETRAHEDRON
                | {"face_normals": False, "vertex_normals": TETRAHEDRON["vertex_positions"] + 1.0, "m": METER}
            },
            "on a mesh with normals of its vertices",
        ),
    ],
    ids=lambda value: "",
)
def test_what_cannot_be_measured_is_an_error(given, message):
    with pytest.raises(Error, match=message):
        load_dict({"type": "scene", "sky": SKY, **given})


def test_a_dict_of_a_view_cannot_be_one():
    with pytest.raises(Error, match="outside a shape"):
        seen_by(scene_of({"type": "rectangle"}), METER)
