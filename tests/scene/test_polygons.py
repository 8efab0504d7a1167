"""Polygons of mesh files cover as triangles what they cover; given texture coordinates stay."""

import struct

import numpy as np
import pytest
from mesh_files import ascii_ply, ply_header

from clvol.scene.mesh import mesh_flaws
from clvol.scene.mesh_files import read_mesh
from clvol.scene.polygons import triangulate

PLUS = [(1, 0), (2, 0), (2, 1), (3, 1), (3, 2), (2, 2), (2, 3), (1, 3), (1, 2), (0, 2), (0, 1), (1, 1)]
FRAME = [
    (0, 0),
    (3, 0),
    (3, 3),
    (0, 3),
    (0, 0),
    (1, 1),
    (1, 2),
    (2, 2),
    (2, 1),
    (1, 1),
]  # a hole, by a bridge
COMB = [(0, 0), (9, 0), (9, 5), (8, 5), (8, 1), (6, 1), (6, 5), (5, 5), (5, 1), (3, 1), (3, 5), (0, 5)]
SHAPES = {  # corners in a plane, and their area
    "arrowhead": ([(0, 0), (2, 1), (0, 2), (0.5, 1)], 1.5),
    "L": ([(2, 1), (1, 1), (1, 2), (0, 2), (0, 0), (2, 0)], 3),
    "plus": (PLUS, 5),
    "comb": (COMB, 29),
    "corners on straight edges": (
        [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 1.5), (1, 2), (0, 2), (0, 1)],
        3,
    ),
    "corners twice": ([(0, 0), (2, 0), (2, 0), (2, 1), (1, 1), (1, 1), (1, 2), (0, 2)], 3),
    "touching itself": ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], 8),
    "frame": (FRAME, 8),
    "quad with a corner on an edge": ([(0, 0), (1, 0), (2, 0), (0, 2)], 2),
}


@pytest.fixture
def read(tmp_path):
    def from_bytes(data, kind="obj", **more):
        path = tmp_path / f"mesh.{kind}"
        path.write_bytes(data)
        return read_mesh(path, kind, **more)[0]

    return from_bytes


def obj(points, *faces):
    rows = [b"v %r %r %r" % tuple(map(float, p)) for p in points]
    return b"\n".join([*rows, *(b"f " + b" ".join(b"%d" % (n + 1) for n in face) for face in faces), b""])


def areas(mesh):
    a, b, c = mesh.vertices[mesh.faces].astype(float).transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


def in_space(flat, z=0.0):
    return [(x, y, z) for x, y in flat]


@pytest.mark.parametrize("kind", ["obj", "ply"])
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("turned", [False, True])
def test_a_polygon_covers_its_area_and_faces_its_way(read, name, kind, turned):
    """From whichever corner it begins."""
    flat, area = SHAPES[name]
    for first in range(len(flat)):
        points = in_space(flat[first:] + flat[:first])[:: -1 if turned else 1]
        data = obj(points, range(len(flat))) if kind == "obj" else ascii_ply(points, [range(len(flat))])
        found = areas(read(data, kind))[:, 2] * (-1 if turned else 1)
        assert (found > 0).all()
        assert found.sum() == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize("name", [name for name in SHAPES if name != "touching itself"])
def test_a_prism_over_a_polygon_is_closed(read, name):
    """Also where corners lie on straight edges: none is left out.  Turned, so that nothing is exact."""
    flat, area = SHAPES[name]
    count = len(flat)
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    for matrix in np.eye(3), turn:
        points = (np.array(in_space(flat) + in_space(flat, 1.0)) @ matrix.T).astype(np.float32)
        sides = [(n, (n + 1) % count, count + (n + 1) % count, count + n) for n in range(count)]
        faces = [range(count)[::-1], range(count, 2 * count), *sides]
        mesh = read(obj(points, *faces))
        assert mesh_flaws(mesh) == []
        a, b, c = mesh.vertices[mesh.faces].astype(float).transpose(1, 0, 2)
        assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(area, rel=1e-5)


def test_star_polygons_of_many_corners(read):
    """Each from 4 to 40 corners, round a point that sees all of them; the area by the shoelace formula."""
    rng = np.random.default_rng(3)
    points, faces, area = [], [], 0.0
    for _ in range(200):
        count = rng.integers(4, 41)
        angle = 2 * np.pi * (np.arange(count) + rng.uniform(0, 0.9, count)) / count
        x, y = rng.uniform(0.1, 1, count) * (np.cos(angle), np.sin(angle))
        area += (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
        faces.append(range(len(points), len(points) + count))
        points += in_space(zip(x, y, strict=True))
    found = areas(read(obj(points, *faces)))[:, 2]
    assert found.min() > 0
    assert found.sum() == pytest.approx(area, rel=1e-6)


def test_triangles_and_convex_polygons_stay_fans():
    angle = 2 * np.pi * np.arange(5) / 5
    pentagon = in_space(zip(np.cos(angle), np.sin(angle), strict=True))
    quad = [(0, 0, 0), (1, 0, 0.1), (1, 1, 0), (0, 1, 0.1)]  # in no plane
    pole = [(0, 0, 0), (0, 0, 0), (1, 0, 0), (1, 1, 0)]
    points = np.array([*pentagon, *quad, *pole, *quad[:3]])
    found = triangulate(points, np.array([5, 4, 4, 3]))
    fans = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (5, 6, 7), (5, 7, 8), (9, 10, 11), (9, 11, 12), (13, 14, 15)]
    np.testing.assert_array_equal(found, fans)


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1.0, 1e30])
def test_triangles_do_not_depend_on_the_scale(scale):
    points = np.array(in_space(PLUS)) * scale
    if scale == 1e-200:  # its area is 0 in double, the fan is as good as any
        assert triangulate(points, np.array([12])).shape == (10, 3)
    else:
        np.testing.assert_array_equal(
            triangulate(points, np.array([12])), triangulate(np.array(in_space(PLUS)), np.array([12]))
        )


@pytest.mark.parametrize(
    "flat",
    [[(0, 0), (1, 1), (1, 0), (0, 1)], [(0, 0), (2, 2), (2, 0), (0, 1)]],
    ids=["a bow-tie of no area", "a bow-tie"],
)
def test_a_polygon_that_crosses_itself_is_warned_of(read, flat, caplog):
    assert len(read(obj(in_space(flat), range(4))).faces) == 2
    assert "1 of 1 polygons cross themselves" in caplog.text


# -- texture coordinates and normals of some faces -------------------------------------------------

TEXTURED = b"v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 1 -1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def corners(mesh, of):
    return np.asarray(getattr(mesh, of))[mesh.faces]


@pytest.mark.parametrize("flip", [False, True])
def test_a_face_without_texture_coordinates_takes_none_from_the_others(read, flip, caplog):
    mesh = read(TEXTURED + b"f 1/1 2/2 3/3 4/4\nf 2 5 6 3\n", flip_tex_coords=flip)
    given = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], float)
    given[..., 1] = 1 - given[..., 1] if flip else given[..., 1]
    np.testing.assert_array_equal(corners(mesh, "uvs"), [*given, *np.zeros((2, 3, 2))])
    assert "2 of 4 triangles have no texture coordinates" in caplog.text


def test_a_face_without_normals_has_its_own_and_takes_none_from_the_others(read):
    roof = (
        b"v -1 0 0\nv 0 0 1\nv 0 2 1\nv -1 2 0\nv 1 0 0\nv 1 2 0\nvn -0.6 0 0.8\n"
        b"f 1//1 2//1 3//1 4//1\nf 2 5 6 3\nf 5 2 1\n"
    )
    found = corners(read(roof), "normals")
    np.testing.assert_allclose(found[:2], np.broadcast_to((-0.6, 0, 0.8), (2, 3, 3)), atol=1e-7)
    np.testing.assert_allclose(found[2:4], np.broadcast_to((0.5**0.5, 0, 0.5**0.5), (2, 3, 3)), atol=1e-7)
    np.testing.assert_allclose(found[4], [(0, -1, 0)] * 3, atol=1e-7)


def test_an_obj_that_begins_with_a_byte_order_mark_keeps_its_first_vertex(read):
    mesh = read(b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    np.testing.assert_array_equal(corners(mesh, "vertices")[0], [(0, 0, 0), (1, 0, 0), (0, 1, 0)])


# -- ply -------------------------------------------------------------------------------------------

QUAD_AND_TRIANGLE = [(0, 1, 2, 3), (1, 4, 2)]
POINTS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)], float)


def mixed_ply(form, names=(), uvs=None):
    """A quad and a triangle; `names` of the vertices' texture coordinates (x, y), or the corners' `uvs`."""
    order = ">" if "big" in form else "<"
    header = ply_header(5, 2, form, ("x", "y", "z", *names))
    if uvs is not None:
        header = header.replace(b"end_header", b"property list uchar float texcoord\nend_header")
    rows = np.concatenate([POINTS, POINTS[:, :2]] if names else [POINTS], axis=1)
    lists = [[face] if uvs is None else [face, uvs[n]] for n, face in enumerate(QUAD_AND_TRIANGLE)]
    if form == "ascii":
        lines = [*rows.tolist(), *([v for part in row for v in (len(part), *part)] for row in lists)]
        return header + "\n".join(" ".join(map(str, line)) for line in lines).encode() + b"\n"
    body = rows.astype(order + "f4").tobytes()
    for row in lists:
        body += struct.pack(f"{order}B{len(row[0])}i", len(row[0]), *row[0])
        body += b"".join(struct.pack(f"{order}B{len(uv)}f", len(uv), *uv) for uv in row[1:])
    return header + body


FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("names", [("u", "v"), ("s", "t"), ("texture_u", "texture_v")])
def test_a_ply_of_mixed_faces_keeps_texture_coordinates_of_any_name(read, form, names):
    mesh = read(mixed_ply(form, names), "ply")
    np.testing.assert_array_equal(corners(mesh, "uvs"), POINTS[[(0, 1, 2), (0, 2, 3), (1, 4, 2)], :2])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("bare", [False, True])
def test_a_ply_of_mixed_faces_keeps_texture_coordinates_of_corners(read, form, bare, caplog):
    """Vertices 1 and 2 have others in each face; in the second case the triangle has none."""
    uvs = [(0, 0, 0.5, 0, 0.5, 1, 0, 1), () if bare else (0.75, 0, 1, 0, 0.75, 1)]
    mesh = read(mixed_ply(form, uvs=uvs), "ply")
    last = [(0, 0)] * 3 if bare else [(0.75, 0), (1, 0), (0.75, 1)]
    given = [[(0, 0), (0.5, 0), (0.5, 1)], [(0, 0), (0.5, 1), (0, 1)], last]
    np.testing.assert_array_equal(corners(mesh, "uvs"), given)
    np.testing.assert_array_equal(corners(mesh, "vertices"), POINTS[[(0, 1, 2), (0, 2, 3), (1, 4, 2)]])
    assert ("1 of 3 triangles have no texture coordinates" in caplog.text) == bare
