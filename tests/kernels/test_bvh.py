"""Rays against triangles: every hit, in order, and none lost where triangles meet; and the trees."""

import numpy as np
import pytest
import trimesh
from rays import NO_BOXES, NO_FACES, NO_VERTICES, Caster, all_hits, directions

from clvol.accel.bvh import HAS_QUADRICS, LEAF, NO_PRIMITIVE, build_bvh, check_mesh, drop_degenerate
from clvol.errors import SceneError
from clvol.layout import BVH_MOST_DEPTH, BVH_PACKET

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def soup(generator, count, size=0.2):
    """Separate triangles in the unit cube."""
    corners = generator.uniform(0, 1, (count, 1, 3)) + generator.uniform(-size, size, (count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def sphere(subdivisions=3):
    """A closed mesh."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32)


def assert_first_hits(caster, vertices, faces, o, d):
    """The device's first hits are float64's, but for triangles whose edge is within a part in 10⁵."""
    hits = caster.closest(o, d)
    t, weight = all_hits(vertices, faces, o, d)
    beyond_doubt = np.where((weight > 1e-5) & (t > 1e-5), t, np.inf)
    possible = np.where((weight > -1e-5) & (t > -1e-5), t, np.inf)
    assert np.isfinite(beyond_doubt.min(axis=1))[hits.any].mean() > 0.9
    assert hits.any[np.isfinite(beyond_doubt.min(axis=1))].all()
    ray = np.flatnonzero(hits.any)
    assert np.allclose(hits.t[ray], t[ray, hits.primitive[ray]], rtol=2e-5, atol=2e-6)
    assert (weight[ray, hits.primitive[ray]] > -1e-5).all()
    assert (hits.t[ray] <= beyond_doubt.min(axis=1)[ray] * (1 + 2e-5) + 2e-6).all()
    assert (hits.t[ray] >= possible.min(axis=1)[ray] * (1 - 2e-5) - 2e-6).all()
    assert (caster.any(o, d) == hits.any).all()
    return hits


def test_first_hits_in_a_soup_are_those_of_float64(device):
    generator = np.random.default_rng(1)
    vertices, faces = soup(generator, 700)
    o = generator.uniform(-0.5, 1.5, (2000, 3)).astype(np.float32)
    hits = assert_first_hits(Caster(device, vertices, faces), vertices, faces, o, directions(generator, 2000))
    assert 0.2 < hits.any.mean() < 1


def test_barycentric_weights_give_the_point_that_is_hit(device):
    generator = np.random.default_rng(2)
    vertices, faces = soup(generator, 200)
    o, d = generator.uniform(0, 1, (1000, 3)).astype(np.float32), directions(generator, 1000)
    hits = Caster(device, vertices, faces).closest(o, d)
    a, b, c = (vertices[faces[hits.primitive[hits.any], k]] for k in range(3))
    u, v = hits.u[hits.any, None], hits.v[hits.any, None]
    assert np.allclose(a + u * (b - a) + v * (c - a), (o + hits.t[:, None] * d)[hits.any], atol=5e-6)


@pytest.mark.parametrize("stretch", [1e-2, 1e-4])
def test_first_hits_on_slivers_are_those_of_float64(device, stretch):
    generator = np.random.default_rng(3)
    vertices, faces = soup(generator, 300, size=1.0)
    middle = np.repeat(vertices[faces].mean(axis=1), 3, axis=0)
    vertices = (middle + (vertices - middle) * [1, 1, stretch]).astype(np.float32)
    o = generator.uniform(-0.5, 1.5, (1000, 3)).astype(np.float32)
    assert_first_hits(Caster(device, vertices, faces), vertices, faces, o, directions(generator, 1000))


def test_t_max_excludes_what_is_not_nearer(device):
    generator = np.random.default_rng(4)
    vertices, faces = soup(generator, 300)
    o, d = generator.uniform(0, 1, (500, 3)).astype(np.float32), directions(generator, 500)
    caster = Caster(device, vertices, faces)
    hits = caster.closest(o, d)
    for t_max, expected in ((hits.t, False), (np.nextafter(hits.t, np.float32(9)), True)):
        assert (caster.closest(o, d, t_max).any == (hits.any & expected)).all()
        assert (caster.any(o, d, t_max) == (hits.any & expected)).all()


def test_a_walk_visits_every_hit_once_and_in_order(device):
    generator = np.random.default_rng(5)
    vertices, faces = soup(generator, 400, size=0.5)
    o, d = generator.uniform(-0.2, 1.2, (300, 3)).astype(np.float32), directions(generator, 300)
    t, weight = all_hits(vertices, faces, o, d)
    clear = (~((np.abs(weight) < 1e-5) | (np.abs(t) < 1e-5))).all(axis=1)
    for ray, hits in enumerate(Caster(device, vertices, faces).walk(o, d)):
        assert hits == sorted(set(hits))
        if clear[ray]:
            assert {p for _, p in hits} == set(np.flatnonzero((weight[ray] > 0) & (t[ray] > 0)))
    assert clear.mean() > 0.8


def test_a_walk_visits_coincident_triangles_by_their_number(device):
    generator = np.random.default_rng(6)
    vertices, faces = soup(generator, 40, size=0.6)
    copies = np.tile(faces, (25, 1))
    o, d = generator.uniform(0, 1, (100, 3)).astype(np.float32), directions(generator, 100)
    single = Caster(device, vertices, faces).walk(o, d)
    for once, often in zip(single, Caster(device, vertices, copies).walk(o, d), strict=True):
        assert often == [(t, p + 40 * copy) for t, p in once for copy in range(25)]


def test_coplanar_stacks_are_all_visited(device):
    """Parallel squares, eight in each plane, seen along their normal."""
    generator = np.random.default_rng(7)
    height = np.repeat(np.arange(25), 8).astype(np.float32) / 8
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    vertices = (square + height[:, None, None] * [0, 0, 1]).reshape(-1, 3).astype(np.float32)
    faces = (np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(height))[:, None, None]).reshape(-1, 3)
    o = np.concatenate([generator.uniform(-0.9, 0.9, (50, 2)), np.full((50, 1), -0.5)], axis=1)
    o = o.astype(np.float32)
    for hits in Caster(device, vertices, faces).walk(o, np.tile(np.float32([0, -0.0, 1]), (50, 1))):
        assert np.allclose([t for t, _ in hits], height + 0.5, rtol=1e-6, atol=0)
        assert hits == sorted(set(hits))


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_rays_along_axes_hit_corners_and_edges_of_a_cube(device, zero):
    """Their lines lie in planes of the boxes: 0 times infinity, if anything computed it."""
    lattice = np.linspace(-1, 1, 5)
    mesh = trimesh.creation.box(extents=(2, 2, 2)).subdivide().subdivide()
    caster = Caster(device, np.asarray(mesh.vertices), np.asarray(mesh.faces))
    for axis in range(3):
        for sign in (-1, 1):
            o = np.stack(np.meshgrid(lattice, lattice), axis=-1).reshape(-1, 2)
            o = np.insert(o, axis, -3.0 * sign, axis=1)
            d = np.full(o.shape, zero)
            d[:, axis] = sign
            hits = caster.closest(o, d)
            assert hits.any.all()
            assert (hits.t == 2).all()


@pytest.mark.parametrize("centre", [0.0, 1000.0])
def test_no_ray_leaves_a_closed_mesh_through_its_edges_and_vertices(device, centre):
    vertices, faces = sphere()
    vertices = vertices + np.float32(centre)
    edges = np.concatenate([vertices[faces[:, k]] + vertices[faces[:, k - 1]] for k in range(3)]) / 2
    targets = np.concatenate([vertices, edges, centre + AXES]).astype(np.float32)
    generator = np.random.default_rng(8)
    caster = Caster(device, vertices, faces)
    for _ in range(20):
        o = np.tile((centre + generator.uniform(-0.5, 0.5, 3)).astype(np.float32), (len(targets), 1))
        d = targets - o
        for scaled in (d, d / np.linalg.norm(d, axis=1, keepdims=True)):
            hits = caster.closest(o, scaled)
            assert hits.any.all()
            assert caster.any(o, scaled).all()
    o = np.full((20000, 3), np.float32(centre))
    assert caster.any(o, directions(generator, len(o))).all()


def test_rays_from_outside_hit_the_vertices_and_edges_they_aim_at(device):
    vertices, faces = sphere()
    edges = np.concatenate([vertices[faces[:, k]] + vertices[faces[:, k - 1]] for k in range(3)]) / 2
    targets = np.concatenate([vertices, edges])
    caster = Caster(device, vertices, faces)
    for eye in (*(3 * AXES), np.array([100.0, -70.0, 30.0])):
        d = targets - eye.astype(np.float32)
        facing = -np.sum(d * targets, axis=1) / np.linalg.norm(d, axis=1) > 0.1
        hits = caster.closest(np.tile(eye, (facing.sum(), 1)), d[facing])
        assert hits.any.all()
        assert np.allclose(hits.t, 1, atol=1e-5)


def test_a_large_ground_and_small_details_do_not_leak(device):
    """Coordinates from 10⁻³ to 10⁴: the error of a vertex grows with its distance, not with the scene."""
    generator = np.random.default_rng(9)
    n = 24
    grid = np.stack(np.meshgrid(np.arange(n + 1), np.arange(n + 1)), axis=-1).reshape(-1, 2) - n / 2
    xy = np.sign(grid) * (np.exp(np.abs(grid) * 1.4) - 1) * 1e-3
    vertices = np.insert(xy, 2, -1e-3, axis=1).astype(np.float32)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1, 1)
    faces = (corner[:, :, None] + [[0, 1, n + 2], [0, n + 2, n + 1]]).reshape(-1, 3)
    d = directions(generator, 4000)
    d[:, 2] = -np.abs(d[:, 2]) - np.float32(1e-6)
    d[:1000, :2] *= 1e3
    o = generator.uniform(-1e-4, 1e-4, (4000, 3)).astype(np.float32)
    assert Caster(device, vertices, faces).any(o, d).all()


def test_spot_has_no_leaks(device, data):
    lines = [line.split() for line in (data / "spot.obj").read_text().splitlines()]
    vertices = np.array([line[1:4] for line in lines if line[:1] == ["v"]], np.float32)
    faces = [[int(c.split("/")[0]) - 1 for c in line[1:4]] for line in lines if line[:1] == ["f"]]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    inside = mesh.triangles_center[::600] - 0.01 * mesh.face_normals[::600]
    assert mesh.is_watertight
    caster = Caster(device, vertices, faces)
    for origin in inside.astype(np.float32):
        assert caster.any(np.tile(origin, (len(vertices), 1)), vertices - origin).all()


def leaves_of(bvh):
    """References of all leaves."""
    references = bvh.nodes[:, 6].view(np.uint32)[np.isfinite(bvh.nodes[:, 0])]
    return references[(references & LEAF) != 0]


HARD = {
    "identical": lambda n: np.tile(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), (n, 1, 1)),
    "coplanar": lambda n: (
        np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) + np.arange(n)[:, None, None] * np.float32([0.1, 0, 0])
    ),
    "exponential": lambda n: (
        np.float32([[1, 0, 0], [1, 1, 0], [1, 0, 1]])
        * np.float32(1.1) ** np.arange(-n // 2, n // 2)[:, None, None]
    ),
    "concentric": lambda n: (
        np.float32([[-1, -1, 0], [1, -1, 0], [0, 2, 0]]) * (1 + np.arange(n)[:, None, None])
    ),
    "one": lambda n: np.float32([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]),
}


@pytest.mark.parametrize("name", HARD)
def test_hard_inputs_give_bounded_trees_that_hold_every_triangle_once(name):
    corners = HARD[name](700).astype(np.float32)
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    bvh = build_bvh(corners.reshape(-1, 3), faces, NO_BOXES)
    numbers = bvh.packets[:, 9].view(np.uint32)
    assert np.array_equal(np.sort(numbers[numbers != NO_PRIMITIVE]), np.arange(len(faces)))
    assert np.array_equal(np.sort(leaves_of(bvh) & ~LEAF), np.arange(len(bvh.packets)))
    assert bvh.depth <= BVH_MOST_DEPTH
    assert bvh.stack <= 7 * bvh.depth + 1
    assert len(bvh.packets) <= max(1, len(faces) // (BVH_PACKET // 4))


def test_boxes_hold_their_triangles_with_room():
    """As much as the triangle test may move a vertex: see clvol/accel/bvh.py."""
    vertices, faces = soup(np.random.default_rng(14), 500, size=30.0)
    bvh = build_bvh(vertices, faces, NO_BOXES)
    references = bvh.nodes[:, 6].view(np.uint32)
    node, child = np.nonzero(((references & LEAF) != 0) & np.isfinite(bvh.nodes[:, 0]))
    packets = bvh.packets[references[node, child] & ~LEAF]
    used = packets[:, 9].view(np.uint32) != NO_PRIMITIVE
    room = 0.9 * 2.0**-20 * np.max([np.ptp(packets[:, axis:9:3], axis=1) for axis in range(3)], axis=0)
    for axis in range(3):
        corners = packets[:, axis:9:3].astype(np.float64)
        lower, upper = (bvh.nodes[node, 2 * axis + side, child][:, None] for side in range(2))
        assert (lower < corners.min(axis=1) - room)[used].all()
        assert (upper > corners.max(axis=1) + room)[used].all()


def test_leaves_with_quadrics_are_marked():
    vertices, faces = soup(np.random.default_rng(13), 100)
    boxes = np.float32([[[0.5, 0.5, 0.5], [0.6, 0.6, 0.6]]])
    bvh = build_bvh(vertices, faces, boxes)
    marked = leaves_of(bvh)[(leaves_of(bvh) & HAS_QUADRICS) != 0]
    assert len(marked) == 1
    assert 100 in bvh.packets[marked[0] & ~(LEAF | HAS_QUADRICS), 9].view(np.uint32)
    assert (bvh.triangles, bvh.quadrics) == (100, 1)


def test_degenerate_triangles_are_dropped_and_counted():
    vertices = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [0, 0, 0], [1e-20, 0, 0]])
    faces = np.array([[0, 1, 2], [0, 0, 1], [0, 1, 3], [0, 4, 2], [0, 5, 2]])
    kept, dropped = drop_degenerate(vertices, faces)
    assert kept.tolist() == [0, 4]
    assert dropped == 3


@pytest.mark.parametrize(
    ("vertices", "faces", "says"),
    [
        ([[0, 0, 0]], NO_FACES, "no faces"),
        ([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], [[0, 1, 2]], "vertex 1 is"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "vertex 2 is"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 3]], r"face 1 is \(0, 1, 3\).*3 vertices"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, -1]], "face 0"),
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], "shape"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0.0, 1.0, 2.0]], "not integers"),
        (NO_VERTICES, [[0, 1, 2]], "0 vertices"),
    ],
)
def test_a_broken_mesh_is_refused_by_name(vertices, faces, says):
    with pytest.raises(SceneError, match=rf"teapot.*{says}"):
        check_mesh(np.array(vertices, np.float32), np.array(faces), "teapot")
