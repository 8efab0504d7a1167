"""Meshes: what their files hold arrives, broken files are errors, and flaws of a medium's bound are seen.

Numbers called Mitsuba's were printed by version 3.9.1 (scalar_rgb).
"""

import tracemalloc

import numpy as np
import pytest
import trimesh
from mesh_files import TETRAHEDRON_OBJ, ascii_ply, binary_ply, glb, ply_header

from clvol.errors import SceneError
from clvol.scene import gltf, load_dict, scale
from clvol.scene.mesh import mesh_flaws
from clvol.scene.primitives import canonical_mesh
from clvol.scene.records import Mesh

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


@pytest.fixture
def load(tmp_path):
    """Writes a file and loads it as a shape."""

    def read(data, kind, **parameters):
        path = tmp_path / f"mesh.{kind}"
        path.write_bytes(data)
        shape = {"type": kind, "filename": str(path)} | parameters
        camera = {"type": "perspective", "fov": 40}
        return load_dict({"type": "scene", "camera": camera, "thing": shape}).shapes[0]

    return read


@pytest.fixture
def mesh(load):
    return lambda data, kind, **parameters: load(data, kind, **parameters).mesh


def corners(mesh, of):
    """What `of` (vertices, normals, uvs) is at the corners of every triangle: numbering is no matter."""
    return np.asarray(getattr(mesh, of))[mesh.faces]


# -- obj -------------------------------------------------------------------------------------------

TWO_QUADS = b"""v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 2 1 0
vt 0 0.25
vt 1 0.25
vt 1 1
vt 0 1
vt 0.5 0.5
vn 0 0 1
vn 0 0.6 0.8
f 1/1/1 2/2/1 3/3/1 4/4/1
f 2/1/2 5/2/2 6/3/2 3/5/2
"""


def test_every_index_of_an_obj_counts_as_in_mitsuba(mesh):
    """Positions two faces share keep both texture coordinates and normals; v is turned over by default."""
    found = mesh(TWO_QUADS, "obj")
    mitsuba = [(0, 0), (1, 0), (1, 1), (0, 1), (1, 0), (2, 0), (2, 1), (1, 1)]
    np.testing.assert_array_equal(found.vertices[:, :2], mitsuba)
    np.testing.assert_array_equal(found.faces, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    np.testing.assert_allclose(found.normals, [(0, 0, 1)] * 4 + [(0, 0.6, 0.8)] * 4, atol=1e-7)
    uvs = [(0, 0.75), (1, 0.75), (1, 0), (0, 0), (0, 0.75), (1, 0.75), (1, 0), (0.5, 0.5)]
    np.testing.assert_allclose(found.uvs, uvs, atol=1e-7)
    assert (found.vertices.dtype, found.faces.dtype) == (np.float32, np.int32)
    kept = mesh(TWO_QUADS, "obj", flip_tex_coords=False)
    np.testing.assert_allclose(kept.uvs[:, 1], 1 - found.uvs[:, 1], atol=1e-7)
    assert mesh(TWO_QUADS, "obj", face_normals=True).normals is None


def test_other_ways_to_write_an_obj_mean_the_same(mesh):
    """Negative indices, tabs, comments, Windows lines, continued lines, vertex colours, other statements."""
    plain = mesh(TWO_QUADS, "obj")
    lines = TWO_QUADS.replace(b"f 2/1/2 5/2/2", b"f -5/-5/-1 -2/-4/-1")
    odd = b"# two quads\r\nmtllib no.mtl\r\no thing\r\ng a b\r\n" + lines.replace(b"\n", b"\r\n")
    odd = odd.replace(b"v 1 0 0\r\n", b"v\t1 0 0 0.5 0.5 0.5\r\n").replace(
        b"f 1/1/1 2/2/1", b"f  1/1/1 \\\r\n2/2/1"
    )
    found = mesh(
        odd.replace(b"vn 0 0 1", b"vn 0 0 1 # up") + b"usemtl x\ns 1\nl 1 2\nf 1//1 3//1 2//1 # end\n", "obj"
    )
    np.testing.assert_array_equal(corners(found, "vertices")[:4], corners(plain, "vertices"))
    np.testing.assert_array_equal(corners(found, "normals")[:4], corners(plain, "normals"))
    np.testing.assert_array_equal(corners(found, "uvs")[:4], corners(plain, "uvs"))
    assert not corners(found, "uvs")[4].any()  # the last triangle has none


def test_an_obj_whose_corners_differ_is_read_corner_by_corner(mesh):
    """As many slashes as if every corner had one."""
    found = mesh(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 1\nvt 0 0\nvn 0 0 1\nf 1/2 2/1/1 3\n", "obj")
    np.testing.assert_array_equal(corners(found, "vertices")[0], [(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    np.testing.assert_array_equal(corners(found, "uvs")[0], [(0, 1), (0.5, 0), (0, 0)])


def test_hard_edges_of_an_obj_stay_hard(mesh):
    """Trimesh would keep one normal for a position."""
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 -2\nvn 0 -1 0\nf 1//1 3//1 2//1\nf 1//2 2//2 4//2\n"
    normals = corners(mesh(data, "obj"), "normals")
    np.testing.assert_array_equal(normals, np.repeat([[(0, 0, -1)], [(0, -1, 0)]], 3, axis=1))


# -- normals ---------------------------------------------------------------------------------------


def test_missing_normals_are_mitsubas(mesh):
    """Weighted by angles: at the right-angled corner the three faces count alike, whatever their areas."""
    found = mesh(TETRAHEDRON_OBJ, "obj")
    mitsuba = {
        (0, 0, 0): (-0.5773502588, -0.5773502588, -0.5773502588),
        (0, 1, 0): (-0.4114900827, 0.7916011214, -0.4517118632),
        (2, 0, 0): (0.9270083308, -0.1673794686, -0.3356182277),
        (0, 0, 3): (-0.1982519328, -0.1103206053, 0.9739227890),
    }
    for vertex, normal in zip(found.vertices.tolist(), found.normals, strict=True):
        np.testing.assert_allclose(normal, mitsuba[tuple(vertex)], atol=2e-6)


def test_normals_of_length_zero_are_worked_out_and_others_normalised(mesh):
    rows = [(*p, *n) for p, n in zip(SQUARE, [(0, 0, 2), (0, 0, 0), (0, 3, 4), (0, 0, 1)], strict=True)]
    found = mesh(ascii_ply(rows, [(0, 1, 2), (0, 2, 3)], ("x", "y", "z", "nx", "ny", "nz")), "ply")
    np.testing.assert_allclose(found.normals, [(0, 0, 1), (0, 0, 1), (0, 0.6, 0.8), (0, 0, 1)], atol=1e-7)


def test_faces_that_cancel_out_leave_a_normal_all_the_same(mesh):
    found = mesh(ascii_ply(SQUARE, [(0, 1, 2), (2, 1, 0)]), "ply")
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, rtol=1e-6)
    np.testing.assert_array_equal(found.normals[3], (0, 0, 1))  # of no face


# -- ply, stl, gltf --------------------------------------------------------------------------------


@pytest.mark.parametrize("names", [("u", "v"), ("s", "t")])
def test_a_ply_keeps_its_texture_coordinates(mesh, names):
    rows = [(*p, p[0], 0.25 + 0.5 * p[1]) for p in SQUARE]
    data = ascii_ply(rows, [(0, 1, 2), (0, 2, 3)], ("x", "y", "z", *names))
    found = mesh(data, "ply")
    np.testing.assert_allclose(found.uvs, np.array(rows)[:, 3:], atol=1e-7)
    flipped = mesh(data, "ply", flip_tex_coords=True).uvs
    np.testing.assert_allclose(flipped[:, 1], 1 - found.uvs[:, 1], atol=1e-7)


def test_polygons_become_triangles(mesh):
    pentagon = np.array([(np.cos(a), np.sin(a), 0) for a in 2 * np.pi * np.arange(5) / 5])
    data = ascii_ply(pentagon, [range(5)])
    obj = b"".join(b"v %f %f %f\n" % tuple(p) for p in pentagon) + b"f 1 2 3 4 5\n"
    for found in (mesh(data, "ply"), mesh(obj, "obj")):
        a, b, c = corners(found, "vertices").astype(float).transpose(1, 0, 2)
        areas = np.cross(b - a, c - a)[:, 2] / 2
        assert areas.sum() == pytest.approx(2.5 * np.sin(2 * np.pi / 5), rel=1e-5)
        assert (areas > 0).all()


def test_normals_of_a_ply_with_texture_coordinates_stay_with_their_vertices(mesh):
    """Also where a vertex is in no triangle."""
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(7, 8))
    rows[:, 3:6] /= np.linalg.norm(rows[:, 3:6], axis=1, keepdims=True)
    faces = np.array([(6, 5, 2), (2, 5, 0), (0, 1, 6)])  # 3 and 4 are in none
    found = mesh(ascii_ply(rows, faces, ("x", "y", "z", "nx", "ny", "nz", "u", "v")), "ply")
    for of, given in ("vertices", rows[:, :3]), ("normals", rows[:, 3:6]), ("uvs", rows[:, 6:]):
        np.testing.assert_allclose(corners(found, of), given[faces], atol=1e-6)


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_binary_ply_may_mix_triangles_and_other_polygons(mesh, order):
    """Trimesh reads none that does."""
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = ply_header(5, 2, name, ("x", "y", "z", "nx", "ny", "nz", "u", "v"))
    header = header.replace(b"property list", b"property uchar flags\nproperty list").replace(
        b"end_header", b"property float area\nend_header"
    )
    rows = np.array([(*p, 0, 0, 2, p[0], 0.5) for p in [*SQUARE, (2, 0.5, 0)]], order + "f4")
    faces = b""
    for corners_of_face in ((0, 1, 2, 3), (1, 4, 2)):
        indices = np.array(corners_of_face, order + "i4").tobytes()
        faces += bytes([7, len(corners_of_face)]) + indices + np.array(9.0, order + "f4").tobytes()
    found = mesh(header + rows.tobytes() + faces, "ply")
    np.testing.assert_array_equal(found.faces, [(0, 1, 2), (0, 2, 3), (1, 4, 2)])
    np.testing.assert_array_equal(found.vertices, rows[:, :3])
    np.testing.assert_array_equal(found.normals, [(0, 0, 1)] * 5)
    np.testing.assert_array_equal(found.uvs, rows[:, 6:])


@pytest.mark.parametrize("kind", ["ply", "stl", "stl_ascii", "obj", "glb"])
def test_what_trimesh_writes_comes_back(mesh, kind):
    ball = trimesh.creation.icosphere(2, 3.0)
    data = ball.export(file_type=kind)
    found = mesh(data.encode() if isinstance(data, str) else data, kind.removesuffix("_ascii"))
    np.testing.assert_allclose(corners(found, "vertices"), ball.triangles, atol=1e-6)
    assert mesh_flaws(found) == []
    if kind.startswith("stl"):
        assert found.normals is None  # a format of single triangles
    else:
        assert (corners(found, "normals") * corners(found, "vertices") / 3).sum(-1).min() > 0.99


TRIANGLE = {"POSITION": [(0, 0, 0), (1, 0, 0), (0, 1, 0)], "indices": [0, 1, 2]}


def test_the_parts_of_a_gltf_scene_are_put_together(mesh):
    """Under their nodes' transforms; a mirrored part keeps its outside outside."""
    textured = TRIANGLE | {
        "NORMAL": [(0, 0.6, 0.8)] * 3,
        "TEXCOORD_0": [(0, 0.1), (1, 0.1), (0, 1)],
        "material": 0,
    }
    nodes = [{"mesh": 0, "scale": [-2, 1, 1], "translation": [5, 6, 7]}, {"mesh": 1, "name": "second"}]
    plain = TRIANGLE | {"NORMAL": [(0.6, 0, 0.8)] * 3}
    found = mesh(glb([plain, textured], nodes, materials=[{"name": "paint"}]), "glb")
    by_x = np.argsort([triangle.sum() for triangle in corners(found, "vertices")])
    first, second = (found.faces[n] for n in by_x)
    np.testing.assert_allclose(found.vertices[first], TRIANGLE["POSITION"], atol=1e-7)
    np.testing.assert_allclose(found.normals[first], textured["NORMAL"], atol=1e-7)
    # glTF counts v from the picture's top, as bitmaps do
    np.testing.assert_allclose(found.uvs[first], textured["TEXCOORD_0"], atol=1e-7)
    np.testing.assert_allclose(found.vertices[second], [(5, 7, 7), (3, 6, 7), (5, 6, 7)], atol=1e-7)
    perpendicular = np.array([-0.6 / 2, 0, 0.8]) / np.hypot(0.3, 0.8)
    np.testing.assert_allclose(found.normals[second], [perpendicular] * 3, atol=1e-7)


def test_a_gltf_without_a_material_keeps_its_texture_coordinates(mesh):
    uvs = [(0, 0.1), (1, 0.1), (0, 1)]
    found = mesh(glb([TRIANGLE | {"TEXCOORD_0": uvs}], [{"mesh": 0}]), "glb")
    np.testing.assert_allclose(corners(found, "uvs")[0], uvs, atol=1e-7)


def test_a_long_chain_of_nodes_is_walked_once(load, monkeypatch):
    """Each node's matrix is worked out once, and trimesh sees no chain."""
    calls = []
    original = gltf._matrix
    monkeypatch.setattr(gltf, "_matrix", lambda node: calls.append(0) or original(node))
    nodes = [{"translation": [0.5, 0, 0], "children": [n + 1]} for n in range(3000)] + [{"mesh": 0}]
    tree = gltf._plain({"scenes": [{"nodes": [0]}], "nodes": nodes})
    assert len(calls) == 3000
    assert [node.get("children") for node in tree["nodes"]] == [None]
    shape = load(glb([TRIANGLE], nodes, scenes=[{"nodes": [0]}]), "glb")
    moved = corners(shape.mesh, "vertices")[0] + shape.to_world[:3, 3]
    np.testing.assert_array_equal(moved, [(1500, 0, 0), (1501, 0, 0), (1500, 1, 0)])


# -- what cannot be rendered -----------------------------------------------------------------------


def test_triangles_without_an_area_are_dropped_and_counted(mesh, caplog):
    line = [*SQUARE, (0.5, 0.5, 0)]
    found = mesh(ascii_ply(line, [(0, 1, 2), (0, 2, 3), (0, 0, 3), (0, 4, 2)]), "ply")
    assert len(found.faces) == 2
    assert "2 of 4 triangles have no area and are left out" in caplog.text
    assert "mesh.ply" in caplog.text


TWO = ascii_ply(SQUARE, [(0, 1, 2), (0, 2, 3)])
BROKEN = {
    "empty.ply": (b"", "cannot be read as ply"),
    "noise.ply": (bytes(range(256)) * 4, "cannot be read as ply"),
    "no header.ply": (b"ply\n", "cannot be read as ply"),
    "cut off.ply": (binary_ply(SQUARE, [(0, 1, 2), (0, 2, 3)])[:-9], "ends within its faces"),
    "huge.ply": (ply_header(4 * 10**9, 2, "binary_little_endian") + bytes(100), "cannot be read as ply"),
    "endless.ply": (ply_header(0, 4 * 10**9, "binary_little_endian") + bytes(100), "cannot be read as ply"),
    "points.ply": (ascii_ply(SQUARE, []), "no triangles"),
    "no area.ply": (ascii_ply(SQUARE, [(0, 0, 1)]), "none of its triangles has an area"),
    "index.ply": (TWO.replace(b"3 0 2 3", b"3 0 2 4"), "a triangle names vertex 4 of 4"),
    "negative.ply": (TWO.replace(b"3 0 2 3", b"3 0 2 -1"), "a triangle names vertex -1 of 4"),
    "giant index.ply": (TWO.replace(b"3 0 2 3", b"3 0 2 99999999999999999999"), "a triangle names vertex"),
    "nan.ply": (TWO.replace(b"1.0 1.0 0.0", b"1.0 nan 0.0"), "vertex 2 is not finite"),
    "infinite.ply": (TWO.replace(b"1.0 1.0 0.0", b"1.0 1e39 0.0"), "is not finite"),
    "normal.ply": (
        ascii_ply([(*p, 0, 0, np.nan) for p in SQUARE], [(0, 1, 2)], ("x", "y", "z", "nx", "ny", "nz")),
        "normal 0 is not finite",
    ),
    "uv.ply": (
        ascii_ply([(*p, 0, np.inf) for p in SQUARE], [(0, 1, 2)], ("x", "y", "z", "u", "v")),
        "coordinate 0",
    ),
    "empty.obj": (b"", "no triangles"),
    "noise.obj": (bytes(range(256)) * 4, "no triangles"),
    "index.obj": (TETRAHEDRON_OBJ + b"f 1 2 5\n", "a face names position 5 of 4"),
    "below.obj": (TETRAHEDRON_OBJ + b"f -1 -2 -9\n", "a face names position"),
    "zero.obj": (TETRAHEDRON_OBJ + b"f 0 1 2\n", "a face names position 0 of 4"),
    "uv index.obj": (TETRAHEDRON_OBJ + b"f 1/1 2/2 3/3\n", "a face names texture coordinate 1 of 0"),
    "two corners.obj": (TETRAHEDRON_OBJ + b"f 1 2\n", "fewer than three corners"),
    "short.obj": (TETRAHEDRON_OBJ + b"v 1 2\n", "expected 3 numbers, got '1 2'"),
    "word.obj": (TETRAHEDRON_OBJ + b"v 1 2 x\n", "cannot be read as obj"),
    "letters.obj": (TETRAHEDRON_OBJ + b"f a b c\n", "cannot be read as obj"),
    "fraction.obj": (TETRAHEDRON_OBJ + b"f 1.5 2 3\n", "cannot be read as obj"),
    "nan.obj": (TETRAHEDRON_OBJ.replace(b"v 0 0 3", b"v 0 0 nan"), "is not finite"),
    "noise.stl": (bytes(range(256)) * 4, "cannot be read as stl"),
    "empty.stl": (b"", "no triangles"),
    "huge.stl": (bytes(80) + b"\xff\xff\xff\xff" + bytes(50), "cannot be read as stl"),
    "noise.glb": (bytes(range(256)) * 4, "cannot be read as glb"),
    "empty.glb": (b"", "cannot be read as glb"),
    "cut off.glb": (glb([TRIANGLE], [{"mesh": 0}])[:-40], "cannot be read as glb"),
    "nothing.glb": (glb([], []), "cannot be read as glb"),
    "points.glb": (glb([TRIANGLE | {"indices": [0, 1]}], [{"mesh": 0}]), "cannot be read as glb"),
    "no file.gltf": (
        b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "no.bin", "byteLength": 4}]}',
        "as gltf",
    ),
    "outside.gltf": (
        b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "../mesh.bin", "byteLength": 4}]}',
        "outside its folder",
    ),
    "loop.glb": (glb([TRIANGLE], [{"mesh": 0, "children": [0]}]), "node 0 is below"),
    "words.gltf": (b"not json", "cannot be read as gltf"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_errors_that_name_file_and_shape(load, name):
    data, message = BROKEN[name]
    with pytest.raises(SceneError) as caught:
        load(data, name.split(".")[-1])
    assert message in str(caught.value)
    assert "scene.thing.filename: mesh '" in str(caught.value)
    assert "of shape 'thing'" in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_mesh_needs_a_file_that_exists():
    scene = {"type": "scene", "camera": {"type": "perspective"}}
    with pytest.raises(SceneError, match=r"scene\.m: shape 'obj' needs a filename"):
        load_dict(scene | {"m": {"type": "obj"}})
    with pytest.raises(SceneError, match=r"scene\.m\.filename: file 'no\.ply' does not exist"):
        load_dict(scene | {"m": {"type": "ply", "filename": "no.ply"}})
    with pytest.raises(SceneError, match="unknown parameter 'flip_tex_coords'"):
        load_dict(scene | {"m": {"type": "sphere", "flip_tex_coords": True}})


# -- precision and size ----------------------------------------------------------------------------


def test_a_mesh_far_from_its_origin_keeps_its_digits(load):
    far = np.array([4e6, -2e6, 1e6])
    data = b"".join(b"v %.6f %.6f %.6f\n" % tuple(far + 0.125 * np.array(p)) for p in SQUARE) + b"f 1 2 3 4\n"
    shape = load(data, "obj", to_world=scale(2))
    world = shape.mesh.vertices.astype(float) @ shape.to_world[:3, :3].T + shape.to_world[:3, 3]
    np.testing.assert_allclose(world, 2 * (far + 0.125 * np.array(SQUARE)), rtol=0, atol=2e-6)
    near = load(TETRAHEDRON_OBJ, "obj", to_world=scale(2))
    np.testing.assert_array_equal(near.to_world, scale(2))


def wave(side):
    """A height field of 2 (side - 1)² triangles."""
    x, y = (a.reshape(-1) for a in np.meshgrid(np.arange(side), np.arange(side)))
    vertices = np.stack([x, y, np.sin(0.1 * x)], axis=1).astype(np.float32)
    first = (x + side * y).reshape(side, side)[:-1, :-1].reshape(-1)
    lower, upper = (
        np.stack([first, first + 1, first + side], 1),
        np.stack([first + 1, first + side + 1, first + side], 1),
    )
    return vertices, np.concatenate([lower, upper]).astype(np.int32)


def test_a_million_triangles_need_little_memory(mesh):
    vertices, faces = wave(708)
    data = binary_ply(vertices, faces)
    tracemalloc.start()
    try:
        found = mesh(data, "ply")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(found.faces) == 999_698
    assert peak < 10 * (vertices.nbytes + faces.nbytes)
    assert found.normals[:, 2].min() > 0.99


# -- as the bound of a medium ----------------------------------------------------------------------


def cube_with(faces=None, vertices=None):
    cube = canonical_mesh("cube")
    return Mesh(cube.vertices if vertices is None else vertices, cube.faces if faces is None else faces)


def test_a_closed_mesh_has_no_flaws_whether_or_not_its_vertices_are_shared():
    cube = cube_with()
    assert mesh_flaws(cube) == []
    soup = Mesh(cube.vertices[cube.faces].reshape(-1, 3), np.arange(36, dtype=np.int32).reshape(12, 3))
    assert mesh_flaws(soup) == []
    negative_zeros = np.where(cube.vertices == -1, np.float32(0), cube.vertices)
    negative_zeros[::2] = np.where(negative_zeros[::2] == 0, np.float32(-0.0), negative_zeros[::2])
    assert mesh_flaws(cube_with(vertices=negative_zeros)) == []


def test_flaws_of_a_bound_are_counted():
    faces = canonical_mesh("cube").faces
    assert mesh_flaws(cube_with(faces[1:])) == ["3 open edges"]
    turned = faces.copy()
    turned[0] = turned[0, ::-1]
    assert mesh_flaws(cube_with(turned)) == ["3 edges whose triangles face opposite sides"]
    assert mesh_flaws(cube_with(faces[:, ::-1])) == ["triangles that face inwards (volume -8)"]
    assert mesh_flaws(canonical_mesh("rectangle")) == ["4 open edges"]
    there_and_back = np.concatenate([faces, faces[:, ::-1]])
    assert mesh_flaws(cube_with(there_and_back)) == ["no volume inside"]
    vertices = canonical_mesh("cube").vertices.copy()
    vertices[0] += np.float32(1e-6)  # a crack
    assert mesh_flaws(cube_with(vertices=vertices))[0].endswith("open edges")
    two = np.concatenate([faces, faces + 24]).astype(np.int32)
    beside = np.concatenate(
        [canonical_mesh("cube").vertices, canonical_mesh("cube").vertices + np.float32(2)]
    )
    assert mesh_flaws(Mesh(beside, two)) == []


@pytest.mark.parametrize(
    ("kind", "point", "uv"),  # Mitsuba's
    [
        ("cube", (-0.3, 1, 0.25), (0.65, 0.375)),
        ("cube", (-0.3, 0.1, 1), (0.55, 0.35)),
        ("cube", (-1, 0.1, 0.25), (0.55, 0.625)),
        ("rectangle", (0.3, 0.5, 0), (0.65, 0.75)),
    ],
)
def test_texture_coordinates_of_cube_and_rectangle_are_mitsubas(kind, point, uv):
    found = canonical_mesh(kind)
    for face in found.faces:
        weights, residual, *_ = np.linalg.lstsq(
            np.vstack([found.vertices[face].T, np.ones(3)]), np.array([*point, 1.0]), rcond=None
        )
        if (weights > -1e-9).all() and residual.size and residual[0] < 1e-12:
            np.testing.assert_allclose(weights @ found.uvs[face], uv, atol=1e-6)
            break
    else:
        pytest.fail("no triangle holds the point")


def test_the_rectangle_faces_plus_z_and_the_cube_outwards():
    for kind, outward in (("rectangle", lambda middle: (0, 0, 1)), ("cube", lambda middle: middle)):
        a, b, c = corners(canonical_mesh(kind), "vertices").transpose(1, 0, 2)
        normals, middles = np.cross(b - a, c - a), (a + b + c) / 3
        assert all(n @ np.array(outward(m)) > 0 for n, m in zip(normals, middles, strict=True))
