"""Rays against spheres, disks and cylinders, and against triangles among them."""

import numpy as np
import pytest
from rays import QUADRIC_KINDS, Caster, directions

from clvol import layout


def quadric(kind, local_from_world=None, shape=0):
    """One record; the map is 3 × 4."""
    record = np.zeros(1, layout.QUADRIC)
    record["local_from_world"] = (np.eye(4)[:3] if local_from_world is None else local_from_world).reshape(-1)
    record["kind"], record["shape"] = QUADRIC_KINDS[kind], shape
    return record


def quadric_caster(device, kind, world_from_local=None):
    """A caster of one quadric under a map, 4 × 4."""
    matrix = np.eye(4) if world_from_local is None else world_from_local
    lower, upper = {"sphere": (-1, 1), "disk": (0, 0), "cylinder": (0, 1)}[kind]
    corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [lower, upper]), axis=-1).reshape(-1, 3)
    corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
    box = np.stack([corners.min(axis=0), corners.max(axis=0)])[None].astype(np.float32)
    return Caster(device, quadrics=quadric(kind, np.linalg.inv(matrix)[:3]), boxes=box)


def expected_quadric_hits(kind, o, d):
    """Both crossings' t in float64, (rays, 2), sorted, inf for none; and how nearly they are not hits."""
    o, d = o.astype(np.float64), d.astype(np.float64)
    if kind == "disk":
        t = -o[:, 2] / d[:, 2]
        margin = 1 - np.sum((o + t[:, None] * d)[:, :2] ** 2, axis=1)
        t = np.stack([np.where((margin >= 0) & (t > 0), t, np.inf), np.full(len(o), np.inf)], axis=1)
        return t, np.abs(margin)
    k = 3 if kind == "sphere" else 2
    a, b, c = np.sum(d[:, :k] ** 2, axis=1), np.sum((o * d)[:, :k], axis=1), np.sum(o[:, :k] ** 2, axis=1) - 1
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - a * c)
    t = np.stack([-b - root, -b + root], axis=1) / a[:, None]
    z = o[:, 2:] + t * d[:, 2:]
    inside = (z >= 0) & (z <= 1) if kind == "cylinder" else np.isfinite(t)
    margin = np.abs(b * b / a - c)
    if kind == "cylinder":
        margin = np.minimum(margin, np.nan_to_num(np.minimum(np.abs(z), np.abs(1 - z)).min(axis=1), nan=1))
    return np.sort(np.where(inside & (t > 0), t, np.inf), axis=1), margin


@pytest.mark.parametrize("kind", list(QUADRIC_KINDS))
def test_quadrics_are_hit_where_the_closed_form_says(device, kind):
    generator = np.random.default_rng(10)
    o = generator.uniform(-2, 2, (3000, 3)).astype(np.float32)
    o[::3] *= 0.2
    d = directions(generator, len(o))
    expected, margin = expected_quadric_hits(kind, o, d)
    caster = quadric_caster(device, kind)
    clear = margin > 1e-4
    first = caster.closest(o, d)
    second = caster.closest(o, d, after_t=first.t, after_primitive=first.primitive)
    assert (caster.any(o, d) == first.any).all()
    for hits, t in ((first, expected[:, 0]), (second, expected[:, 1])):
        assert (hits.any == np.isfinite(t))[clear].all()
        both = clear & hits.any
        assert np.allclose(hits.t[both], t[both], rtol=1e-4, atol=1e-5)
    assert first.any.mean() > 0.1


def test_a_transformed_sphere_is_hit_where_the_point_is_on_it(device):
    generator = np.random.default_rng(11)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = generator.normal(size=(3, 3)), (5, -3, 2)
    o = (matrix[:3, 3] + generator.normal(size=(1000, 3)) * 4).astype(np.float32)
    towards = (matrix[:3, 3] + 0.3 * generator.normal(size=(1000, 3)) - o).astype(np.float32)
    hits = quadric_caster(device, "sphere", matrix).closest(o, towards)
    points = (o + hits.t[:, None].astype(np.float64) * towards)[hits.any] - matrix[:3, 3]
    assert hits.any.mean() > 0.5
    assert np.allclose(np.linalg.norm(points @ np.linalg.inv(matrix[:3, :3]).T, axis=1), 1, atol=1e-4)


def test_a_sphere_far_away_keeps_its_digits(device):
    d = np.float32([[0, 0, 1], [0.0002, 0, 1]])
    o = np.float32([[0.5, 0, -3000], [0, 0, -3000]])
    expected = [3000 - np.sqrt(0.75), 3000 - 0.8]
    assert np.allclose(quadric_caster(device, "sphere").closest(o, d).t, expected, rtol=0, atol=2e-3)


def test_rays_that_leave_a_sphere_do_not_hit_where_they_start(device):
    """The origin is rounded, so that a ray may begin inside, by an ulp: it then leaves within a few."""
    generator = np.random.default_rng(12)
    o, d = directions(generator, 20000), directions(generator, 20000)
    cosine = np.sum(o * d, axis=1)
    hits = quadric_caster(device, "sphere").closest(o, d)
    outward = cosine > 0.01
    assert (~hits.any | (hits.t * cosine < 4e-7))[outward].all()
    inward = cosine < -0.01
    far = hits.any & (hits.t > 1e-3)
    assert (far | (hits.t * -cosine < 4e-7))[inward].all()


def test_triangles_and_quadrics_share_one_order(device):
    """A square at z = 0, a sphere about it and a disk in the square: numbers follow the triangles'."""
    vertices = np.float32([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    quadrics = np.concatenate([quadric("sphere"), quadric("disk")])
    boxes = np.float32([[[-1, -1, -1], [1, 1, 1]], [[-1, -1, 0], [1, 1, 0]]])
    o, d = np.float32([[0.25, 0.5, -4], [1.5, 0.5, -4], [3, 0, -4]]), np.tile(np.float32([0, 0, 1]), (3, 1))
    walks = Caster(device, vertices, faces, quadrics, boxes).walk(o, d)
    root = np.sqrt(1 - 0.25**2 - 0.5**2)
    assert [p for _, p in walks[0]] == [2, 1, 3, 2]
    assert np.allclose([t for t, _ in walks[0]], [4 - root, 4, 4, 4 + root])
    assert walks[1:] == [[(4.0, 0)], []]
