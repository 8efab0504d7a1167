"""Meshes that bound media face outwards, triangles count once, and what floats cannot hold is refused."""

import numpy as np
import pytest

import clvol
from clvol.scene.orientation import facing_outwards
from clvol.scene.records import Mesh


def cube(lower=0.0, upper=1.0, inwards=False):
    corners = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    return lower + (upper - lower) * corners, faces[:, ::-1] if inwards else faces


def together(*cubes):
    first = np.cumsum([0, *(len(v) for v, _ in cubes)])
    faces = np.concatenate([f + n for (_, f), n in zip(cubes, first, strict=False)]).astype(np.int32)
    return Mesh(np.concatenate([v for v, _ in cubes]).astype(np.float32), faces)


def test_closed_parts_that_face_inwards_are_turned_and_cavities_are_not():
    shell, cavity, island = cube(0, 4), cube(1, 3, inwards=True), cube(1.5, 2.5)
    apart = cube(5, 6)
    right = together(shell, cavity, island, apart)
    assert facing_outwards(right) == (right, 0)
    wrong = together(cube(0, 4, inwards=True), cavity, island, cube(5, 6, inwards=True))
    mesh, turned = facing_outwards(wrong)
    assert turned == 2
    np.testing.assert_array_equal(np.sort(mesh.faces, axis=1), np.sort(right.faces, axis=1))
    a, b, c = mesh.vertices[mesh.faces].astype(float).transpose(1, 0, 2)
    assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(64 - 8 + 1 + 1)


def test_a_mesh_that_is_inside_out_as_a_whole_is_turned_as_a_whole():
    right = together(cube(0, 4), cube(1, 3, inwards=True), cube(1.5, 2.5), cube(5, 6))
    mesh, turned = facing_outwards(Mesh(right.vertices, right.faces[:, ::-1].copy()))
    assert turned == 4
    np.testing.assert_array_equal(mesh.faces, right.faces)


def test_a_solid_inside_of_a_solid_stays():
    """Nothing says that it should be a cavity."""
    both = together(cube(0, 4), cube(1, 3))
    assert facing_outwards(both) == (both, 0)


def test_an_open_mesh_is_not_turned():
    vertices, faces = cube(inwards=True)
    mesh = Mesh(vertices, faces[:-1])
    assert facing_outwards(mesh) == (mesh, 0)


def medium_in(tmp_path, faces):
    path = tmp_path / "box.obj"
    vertices = cube()[0]
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines))
    return {
        "type": "scene",
        "sky": {"type": "constant"},
        "box": {
            "type": "obj",
            "filename": str(path),
            "bsdf": {"type": "null"},
            "interior": {"type": "homogeneous", "sigma_t": 1.2, "albedo": 0.0},
        },
        "sensor": {
            "type": "perspective",
            "fov": 0.5,
            "to_world": clvol.look_at([0.5, 0.5, -40], [0.5, 0.5, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
        },
    }


@pytest.mark.parametrize("case", ["inside out", "twice"])
def test_a_medium_in_a_flawed_box_absorbs_as_in_a_sound_one(tmp_path, caplog, case):
    faces = cube(inwards=case == "inside out")[1]
    if case == "twice":
        faces = np.concatenate([faces, np.roll(faces, 1, axis=1)])
    scene = clvol.load_dict(medium_in(tmp_path, faces))
    image = clvol.render(scene, spp=4096, seed=1).image
    assert image.mean() == pytest.approx(np.exp(-1.2), abs=0.02)  # some 10 standard errors
    assert (
        "that face inwards: they are turned" if case == "inside out" else "are there twice"
    ) in caplog.text


@pytest.mark.parametrize("size", [1e-200, 1e300, 1e-25])
@pytest.mark.parametrize("kind", ["cube", "sphere", "rectangle"])
def test_sizes_beyond_floats_are_refused(size, kind):
    with pytest.raises(clvol.SceneError, match=r"the transform scales by .* can be rendered"):
        clvol.load_dict({"type": "scene", "shape": {"type": kind, "to_world": clvol.scale(size)}})


def test_a_texture_without_coordinates_is_warned_of(tmp_path, caplog):
    path = tmp_path / "plain.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    bsdf = {"type": "diffuse", "reflectance": {"type": "checkerboard"}}
    shape = {"type": "obj", "filename": str(path), "bsdf": bsdf}
    clvol.load_dict({"type": "scene", "sensor": {"type": "perspective"}, "mesh": shape})
    assert "has a texture and no texture coordinates" in caplog.text
