"""Curves as tubes: where their surface is, which way it looks, and files that are none."""

from itertools import pairwise

import numpy as np
import pytest

from clvol.errors import Error
from clvol.scene import curves, load_dict
from clvol.scene.materials import FrontOnly

CAMERA = {"type": "perspective", "fov": 30.0}
STRAIGHT = "0 0 0 0.1\n1 0 0 0.1\n2 0 0 0.1\n3 0 0 0.1\n"
BENT = "0 0 0 0.1\n1 0 0 0.3\n2 1 0 0.2\n3 1 2 0.1\n4 0 0 0.1\n"


@pytest.fixture
def load(tmp_path):
    """The one shape of a file of curves."""

    def of(text, kind="bsplinecurve", **more):
        (tmp_path / "curves.txt").write_text(text)
        shape = {"type": kind, "filename": str(tmp_path / "curves.txt"), **more}
        return load_dict({"type": "scene", "camera": CAMERA, "strands": shape}).shapes[0]

    return of


def spline(control, samples=4001):
    """Points and radii of a uniform cubic B-spline by de Boor's recursion, in float64."""
    control, found = np.asarray(control, float), []
    for t in np.linspace(0, len(control) - 3, samples)[:-1]:
        first = int(t)
        points, knot = control[first : first + 4].copy(), t + 3
        for level in range(1, 4):
            for n in range(3, level - 1, -1):
                low = first + n
                share = (knot - low) / (4 - level)
                points[n] = (1 - share) * points[n - 1] + share * points[n]
        found.append(points[3])
    return np.array(found)


def sides(mesh):
    """Middles and normals of the triangles."""
    a, b, c = (mesh.vertices[mesh.faces[:, n]].astype(float) for n in range(3))
    return (a + b + c) / 3, np.cross(b - a, c - a)


def test_a_straight_spline_is_a_cylinder_of_the_right_girth(load):
    mesh = load(STRAIGHT).mesh
    assert mesh.vertices[:, 0].min() == 1
    assert mesh.vertices[:, 0].max() == 2
    radii = np.linalg.norm(mesh.vertices[:, 1:], axis=1)
    np.testing.assert_allclose(radii, 0.1, rtol=0.007)
    _, normals = sides(mesh)
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(2 * np.pi * 0.1, rel=1e-5)


def test_a_tube_is_as_far_from_its_spline_as_that_is_wide(load):
    mesh = load(BENT).mesh
    exact = spline(np.array([line.split() for line in BENT.splitlines()], float))
    middles, normals = sides(mesh)
    for points in (mesh.vertices, middles):
        nearest = ((points[:, None] - exact[None, :, :3]) ** 2).sum(-1).argmin(1)
        inside = (nearest > 0) & (nearest < len(exact) - 1)
        away = points - exact[nearest, :3]
        share = np.linalg.norm(away, axis=1)[inside] / exact[nearest, 3][inside]
        assert np.abs(share - 1).max() < 0.06  # where it grows wider, what is nearest is not what is round it
    assert ((normals * away).sum(1) > 0).all()


@pytest.mark.parametrize("repeated", [3, 4, 6])
def test_a_spline_that_is_held_at_its_ends_is_round_there(load, repeated):
    """Three control points in one place, by which a spline reaches it, leave it no slope there."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    along = np.repeat([0.0, 1, 2, 3], [repeated, 1, 1, repeated])
    points = along[:, None] * turn[0] + (5.0, -3, 7)
    text = "\n".join(" ".join(map(str, [*point, 0.1])) for point in points)
    mesh = load(text).mesh
    vertices = (mesh.vertices.astype(float) + load(text).to_world[:3, 3] - (5, -3, 7)) @ turn.T
    np.testing.assert_allclose(np.linalg.norm(vertices[:, 1:], axis=1), 0.1, rtol=0.007)
    assert vertices[:, 0].min() == pytest.approx(0, abs=1e-5)
    assert vertices[:, 0].max() == pytest.approx(3, abs=1e-5)
    assert np.abs(mesh.normals @ turn[0]).max() < 1e-5


def test_normals_are_those_of_a_surface_that_grows_wider(load):
    """Cones: a half angle whose tangent is the slope of the radius."""
    mesh = load("0 0 0 0.1\n1 0 0 0.2\n2 0 0 0.3\n3 0 0 0.4\n").mesh
    np.testing.assert_allclose(mesh.normals[:, 0], -0.1 / np.hypot(1, 0.1), atol=1e-6)
    assert (np.sum(mesh.normals[:, 1:] * mesh.vertices[:, 1:], axis=1) > 0).all()


def test_linear_curves_are_cones_round_balls(load):
    mesh = load("0 0 0 0.2\n1 0 0 0.2\n1 1 0 0.1\n", "linearcurve").mesh
    lower, upper = mesh.vertices.min(0), mesh.vertices.max(0)
    np.testing.assert_allclose(lower, (-0.2, -0.2, -0.2), rtol=0.01)
    np.testing.assert_allclose(upper, (1.2, 1.1, 0.2), rtol=0.01)
    middles, normals = sides(mesh)
    axis = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0)], float)
    spots = np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(axis)])
    away = middles - spots[((middles[:, None] - spots) ** 2).sum(-1).argmin(1)]
    assert ((normals * away).sum(1) > 0).mean() > 0.99


def test_uvs_go_along_all_curves_of_a_file(load):
    mesh = load(STRAIGHT + "\n\n" + BENT).mesh
    assert np.unique(mesh.uvs[:, 1])[[0, -1]].tolist() == [0, 1]
    assert mesh.uvs[:, 0].max() == 1
    first = mesh.uvs[mesh.vertices[:, 0] == 1]
    assert 0 in first[:, 1]


def test_to_world_moves_points_and_leaves_radii(load):
    mesh = load(STRAIGHT, to_world=np.diag([2.0, 2, 2, 1])).mesh
    assert (mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()) == (2, 4)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices[:, 1:], axis=1), 0.1, rtol=0.007)


def test_a_curve_that_doubles_back_and_one_without_a_radius_at_its_end_have_no_nan(load):
    point, back = "1 1 1 0.1\n" * 4, "0 0 0 0\n1 0 0 0.1\n0 0 0 0.1\n1 0 0 0\n1 0 0 0\n"
    for text, kind in ((back, "bsplinecurve"), (back, "linearcurve"), (point, "linearcurve")):
        mesh = load(text, kind).mesh
        assert np.isfinite(mesh.vertices).all()
        assert np.isfinite(mesh.normals).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no control points"),
        ("\n\n", "no control points"),
        ("0 0 0 .1\n1 0 0 .1\n2 0 0 .1\n", "a curve has 3 control points, and needs 4"),
        ("0 0 0\n", "line 1 is not x, y, z and a radius"),
        ("0, 0, 0, 1\n", "line 1 is not"),
        ("0 0 0 1 7\n", "line 1 is not"),
        (STRAIGHT + "x y z r\n", "line 5 is not"),
        (STRAIGHT.replace("0.1", "-0.1"), "a radius is -0.1"),
        (STRAIGHT.replace("2 0 0", "nan 0 0"), "not finite"),
        (STRAIGHT.replace("2 0 0", "1e300 0 0"), "not finite"),
        (STRAIGHT.replace("0.1", "0"), "none of its triangles has an area"),
    ],
    ids=range(11),
)
def test_files_that_are_no_curves_are_errors(load, text, message):
    with pytest.raises(Error, match=message):
        load(text)


def test_curves_are_seen_from_outside_alone_and_bound_no_medium(load):
    assert isinstance(load(STRAIGHT).bsdf, FrontOnly)
    with pytest.raises(Error, match="curves bound no media"):
        load(STRAIGHT, interior={"type": "homogeneous"})


def test_curves_are_not_turned_inside_out(load):
    """As in Mitsuba, which does not know the parameter there."""
    with pytest.raises(Error, match="unknown parameter 'flip_normals' of shape 'bsplinecurve'"):
        load(STRAIGHT, flip_normals=True)


def test_curves_are_no_meters(load):
    with pytest.raises(Error, match="an irradiancemeter on curves") as told:
        load(STRAIGHT, meter={"type": "irradiancemeter"})
    assert "face_normals" not in str(told.value)


def test_more_triangles_than_there_is_memory_for_are_refused(load, monkeypatch):
    monkeypatch.setattr(curves, "available_memory", lambda: 1000)
    with pytest.raises(Error, match="triangles, which take"):
        load(STRAIGHT)
