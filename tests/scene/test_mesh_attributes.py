"""Attributes of meshes: what PLY files have by which names, what textures show of them, and what is refused.

What PLY files' columns are called was printed by Mitsuba 3.9.1.
"""

import logging

import numpy as np
import pytest
from mesh_files import ascii_ply

import clvol
from clvol.errors import Error
from clvol.scene import load_dict
from clvol.scene.ply import read_ply

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)], float)
FACES = np.array([(0, 1, 2), (1, 3, 2)])
COLOURS = np.array([(0.1, 0.2, 0.3), (0.9, 0.4, 0.1), (0.2, 0.8, 0.6), (0.3, 0.3, 1.0)])
CAMERA = {"type": "perspective", "fov": 30.0}


def shows(name, **more):
    return {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": name, **more}}


def shape_of(bsdf, **more):
    mesh = {"type": "mesh", "vertex_positions": CORNERS, "faces": FACES, "bsdf": bsdf, **more}
    return load_dict({"type": "scene", "camera": CAMERA, "m": mesh}).shapes[0]


def looked_up(bitmap, uv):
    """Bilinear, as the device does it: texel centres at halves, clamped at the borders."""
    height, width = bitmap.pixels.shape[:2]
    x, y = uv[0] * width - 0.5, uv[1] * height - 0.5
    column, row = min(int(x), width - 2), min(int(y), height - 2)
    fx, fy = x - column, y - row
    block = bitmap.pixels[row : row + 2, column : column + 2].astype(float)
    return (1 - fy) * ((1 - fx) * block[0, 0] + fx * block[0, 1]) + fy * (
        (1 - fx) * block[1, 0] + fx * block[1, 1]
    )


@pytest.mark.parametrize("count", [1, 2, 3, 7, 100])
def test_the_picture_of_an_attribute_is_linear_over_every_face(count):
    rng = np.random.default_rng(count)
    corners, colours = rng.uniform(size=(count + 2, 3)), rng.uniform(size=(count + 2, 3))
    faces = np.stack([np.arange(count) + n for n in range(3)], axis=1)
    shape = shape_of(shows("vertex_c"), vertex_positions=corners, faces=faces, vertex_c=colours)
    mesh, picture = shape.mesh, shape.bsdf.reflectance
    assert not mesh.attributes
    np.testing.assert_allclose(mesh.vertices[mesh.faces], corners[faces], atol=1e-6)
    for face, number in zip(mesh.faces, range(count), strict=True):
        share = rng.dirichlet(np.ones(3))
        seen = looked_up(picture, share @ mesh.uvs[face].astype(float))
        np.testing.assert_allclose(seen, share @ colours[faces[number]], atol=1e-4)


def test_an_attribute_of_faces_is_the_same_all_over_each():
    shape = shape_of(shows("face_c", scale=0.5), face_c=np.array([0.4, 0.8]))
    for face, expected in zip(shape.mesh.faces, (0.2, 0.4), strict=True):
        for share in np.eye(3), np.full((1, 3), 1 / 3):
            for weights in share:
                seen = looked_up(shape.bsdf.reflectance, weights @ shape.mesh.uvs[face].astype(float))
                np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_attributes_of_faces_stay_with_theirs_where_others_are_left_out():
    faces = np.array([(0, 0, 1), (0, 1, 2), (0, 1, 2), (1, 3, 2)])
    shape = shape_of(shows("face_c"), faces=faces, face_c=np.array([0.1, 0.2, 0.3, 0.4]))
    at_corners = [looked_up(shape.bsdf.reflectance, shape.mesh.uvs[face[0]])[0] for face in shape.mesh.faces]
    np.testing.assert_allclose(at_corners, (0.2, 0.4), atol=1e-6)


def test_the_picture_is_seen_in_its_place(device):
    """Each of two faces, close: their colours under a white sky."""
    mesh = {"type": "mesh", "vertex_positions": CORNERS * (1, 1, 0), "faces": FACES, "bsdf": shows("face_c")}
    mesh |= {"face_c": np.array([(0.2, 0.4, 0.6), (0.6, 0.4, 0.2)])}
    scene = load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path"},
            "sky": {"type": "constant"},
            "camera": {
                "type": "orthographic",
                "to_world": clvol.look_at((0.5, 0.5, 1), (0.5, 0.5, 0), (0, 1, 0))
                @ clvol.scale([0.4, 0.4, 1]),
                "film": {"type": "hdrfilm", "width": 2, "height": 2, "rfilter": {"type": "box"}},
            },
            "mesh": mesh,
        }
    )
    image = clvol.render(scene, spp=16, seed=1).image
    np.testing.assert_allclose(image[1, 0], (0.2, 0.4, 0.6), rtol=1e-5)
    np.testing.assert_allclose(image[0, 1], (0.6, 0.4, 0.2), rtol=1e-5)


@pytest.mark.parametrize(
    ("columns", "names"),
    [
        (("r", "g", "b"), {"vertex_color": 3}),
        (("red", "green", "blue"), {"vertex_color": 3}),
        (("color_r", "color_g", "color_b"), {"vertex_color_color": 3}),
        (("foo_0", "foo_1", "foo_2"), {"vertex_foo": 3}),
        (("foo_x", "foo_y", "foo_z"), {"vertex_foo": 3}),
        (("a_b_0",), {"vertex_a_b": 1}),
        (("a_r",), {"vertex_a_color": 1}),
        (("a_0", "b_0", "b_1", "b_2"), {"vertex_a": 1, "vertex_b": 3}),
        (("foo",), {}),
        (("foo_x", "foo_y"), {}),
        (("a_r", "a_g", "a_b", "a_a"), {}),
        (("a_01",), {}),
        (("nx", "ny", "nz"), {}),
        (("texture_u", "texture_v"), {}),
    ],
    ids=" ".join,
)
def test_columns_of_ply_have_mitsubas_names(columns, names):
    rows = np.concatenate([CORNERS, np.tile(np.arange(4.0)[:, None], len(columns))], axis=1)
    found = read_ply(ascii_ply(rows, FACES, ("x", "y", "z", *columns))).attributes
    assert {name: values.shape[1] for name, values in found.items()} == names


def test_polygons_of_a_ply_hand_their_values_to_their_triangles():
    header = (
        b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    )
    header += b"element face 2\nproperty list uchar int vertex_indices\nproperty float heat_0\nend_header\n"
    rows = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 0.25\n3 0 1 2 0.75\n"
    raw = read_ply(header + rows)
    assert raw.attributes["face_heat"].tolist() == [[0.25], [0.25], [0.75]]


def test_a_texture_of_the_shape_is_an_attribute_too():
    board = {"type": "checkerboard", "color0": 0.1}
    plate = {"type": "rectangle", "bsdf": shows("vertex_floor"), "vertex_floor": board}
    shape = load_dict({"type": "scene", "camera": CAMERA, "plate": plate}).shapes[0]
    assert shape.bsdf.reflectance.color0 == (0.1,)


def test_a_texture_of_a_shape_that_nothing_shows_is_warned_of(caplog):
    with caplog.at_level(logging.WARNING, "clvol"):
        shape_of({"type": "diffuse"}, vertex_a={"type": "checkerboard"})
    assert "no mesh_attribute of the shape's BSDF shows 'vertex_a'" in caplog.text


def test_shapes_of_one_bsdf_show_what_each_has():
    parts = {
        "type": "mesh",
        "vertex_positions": CORNERS,
        "faces": FACES,
        "bsdf": {"type": "ref", "id": "paint"},
    }
    first, second = ({**parts, "face_a": np.full(2, value)} for value in (0.25, 0.5))
    scene = load_dict({"type": "scene", "camera": CAMERA, "paint": shows("face_a"), "m": first, "n": second})
    assert [shape.bsdf.reflectance.pixels[0, 0, 0] for shape in scene.shapes] == [0.25, 0.5]


@pytest.mark.parametrize(
    ("bsdf", "more", "message"),
    [
        (shows("color"), {}, "begins with vertex_ or face_, not 'color'"),
        (
            {"type": "diffuse", "reflectance": {"type": "mesh_attribute"}},
            {},
            "needs the name of an attribute",
        ),
        (shows("vertex_b"), {"vertex_a": np.ones(4)}, "no attribute 'vertex_b'.*its attributes: vertex_a"),
        (shows("vertex_a"), {"vertex_a": np.full((4, 3), 200)}, r"\[0, 1\].*largest is 200.*scale of 0.0039"),
        (shows("vertex_a"), {"vertex_a": np.full(4, np.nan)}, "vertex_a number 0 is not finite"),
        (shows("vertex_a"), {"vertex_a": np.ones(5)}, "has 5 numbers, not 1 or 3 for each of 4"),
        (shows("face_a"), {"face_a": np.ones(4)}, "has 4 numbers, not 1 or 3 for each of 2"),
        (
            {"type": "mask", "opacity": {"type": "checkerboard"}, "b": shows("vertex_a")},
            {"vertex_a": np.ones(4)},
            "attributes of a mesh and other textures is not supported",
        ),
        (
            shows("vertex_a"),
            {"vertex_a": np.ones(4)}
            | {"emitter": {"type": "area", "radiance": {"type": "bitmap", "bitmap": np.ones((1, 2, 3))}}},
            "attributes of a mesh and other textures is not supported",
        ),
        (shows("vertex_a", scale=0.5), {"vertex_a": {"type": "checkerboard"}}, "'scale' of a mesh_attribute"),
        (
            {
                "type": "normalmap",
                "normalmap": {"type": "bitmap", "bitmap": np.ones((1, 1, 3))},
                "b": shows("vertex_a"),
            },
            {"vertex_a": np.ones(4)},
            "under or in a map of normals",
        ),
        (
            shows("vertex_a"),
            {"vertex_a": {"type": "mesh_attribute", "name": "vertex_a"}},
            "is itself a mesh_attr",
        ),
        (shows("vertex_a", scale=1e300), {"vertex_a": np.ones(4)}, "the largest is inf"),
        (
            {"type": "roughconductor", "alpha_u": 0.1, "alpha_v": 0.3}
            | {"specular_reflectance": {"type": "mesh_attribute", "name": "vertex_a"}},
            {"vertex_a": np.ones(4), "vertex_texcoords": CORNERS[:, :2]},
            "an anisotropic BSDF",
        ),
    ],
    ids=lambda value: "",
)
def test_what_cannot_be_shown_is_an_error(bsdf, more, message):
    with pytest.raises(Error, match=message):
        shape_of(bsdf, **more)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"faces": np.array([(0, 1, 9)])}, "names vertex 9 of 4"),
        ({"faces": np.array([(0, 1, -1)])}, "names vertex -1 of 4"),
        ({"faces": np.array([0, 1])}, "'faces' must be rows of 3"),
        ({"faces": np.array([(0, 1, 0.5)])}, "whole numbers"),
        ({"faces": np.array([(0, 1, np.nan)])}, "whole numbers"),
        ({"faces": np.zeros((0, 3), int)}, "no triangles"),
        ({"faces": "0 1 2"}, "must be an array of numbers"),
        ({"vertex_positions": CORNERS[:, :2]}, "must be rows of 3"),
        ({"vertex_positions": np.full((4, 3), np.inf)}, "not finite"),
        ({"vertex_positions": np.ma.masked_less(CORNERS, 0.5)}, "masked"),
        ({"vertex_normals": CORNERS[:2]}, "'vertex_normals' has 2 rows, there are 4 vertices"),
        ({"vertex_texcoords": np.ones(3)}, "'vertex_texcoords' must be rows of 2"),
    ],
    ids=lambda value: "",
)
def test_arrays_that_are_no_mesh_are_errors(more, message):
    with pytest.raises(Error, match=message):
        shape_of({"type": "diffuse"}, **more)


def test_a_mesh_takes_flat_arrays_as_traverse_shows_them():
    shape = shape_of({"type": "diffuse"}, vertex_positions=CORNERS.reshape(-1), faces=FACES.reshape(-1))
    assert np.array_equal(shape.mesh.vertices, CORNERS)
    assert np.array_equal(shape.mesh.faces, FACES)


class Loaded:
    """What a mesh of Mitsuba is to us, as far as it is looked at."""

    def __init__(self, bsdf="SmoothDiffuse", emitter=None, media=False):
        self.parts, self.media = (bsdf, emitter), media

    def bsdf(self):
        return Named(self.parts[0])

    def emitter(self):
        return self.parts[1] and Named(self.parts[1])

    def is_medium_transition(self):
        return self.media

    def has_face_normals(self):
        return False

    def has_flipped_normals(self):
        return True


class Named(str):
    """A plugin of which the class's name is known."""

    def class_name(self):
        return str(self)


@pytest.fixture
def mitsubas(monkeypatch):
    """Makes what looks like a mesh that Mitsuba has loaded."""
    base = type("Object", (), {"__module__": "mitsuba"})
    kind = type("Mesh", (Loaded, base), {"__module__": "mitsuba"})
    values = {
        "bsdf.reflectance.value": [0.1, 0.2, 0.3],
        "emitter.radiance.value": 2.0,
        "faces": FACES.reshape(-1),
        "vertex_positions": CORNERS.reshape(-1),
        "vertex_normals": np.zeros(0),
        "vertex_texcoords": np.zeros(0),
        "vertex_color": COLOURS.reshape(-1),
    }
    module = type("mitsuba", (), {"traverse": staticmethod(lambda mesh: values.items())})
    monkeypatch.setitem(__import__("sys").modules, "mitsuba", module)
    return kind


def test_meshes_that_mitsuba_has_loaded_are_taken(mitsubas):
    mesh = mitsubas(emitter="AreaLight")
    shape = load_dict({"type": "scene", "camera": CAMERA, "m": mesh}).shapes[0]
    assert shape.bsdf.reflectance == (0.1, 0.2, 0.3)
    assert shape.emission == (2.0,)
    assert shape.flip_normals
    assert np.array_equal(shape.mesh.vertices, CORNERS)


@pytest.mark.parametrize(
    "part",
    [{"bsdf": "Plastic"}, {"emitter": "DirectionalArea"}, {"media": True}],
    ids=lambda part: next(iter(part)),
)
def test_loaded_meshes_that_tell_too_little_are_refused(mitsubas, part):
    with pytest.raises(Error, match="cannot be told from it; give the dict"):
        load_dict({"type": "scene", "camera": CAMERA, "m": mitsubas(**part)})
