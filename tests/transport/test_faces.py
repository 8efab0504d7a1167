"""Rays that run exactly in a face or an edge of a medium's box.

The lower face of each pair counts, the upper does not, whatever the direction, the technique and the
transmittance.
"""

import itertools

import numpy as np
import pytest
from fields import optical_depth
from pictures import box, gridded, homogeneous, picture, volume
from probe import Probe, medium_of, scene_of
from stat_tests import largest_z
from surface_scenes import SKY
from walks import headers_of, transmittance_walks

PLACES = {"lower": 0.0, "inside": 0.37, "upper": 1.0}
BOXES = {
    "whole": ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    "uneven": ((0.1, 0.2, 0.3), (0.7, 1.1, 0.9)),
    "away": ((-3.3, 1.7, 2.1), (-2.2, 3.9, 2.7)),
}
SPANS = """
    Ray ray;
    ray.o = vload3(2 * i, in0);
    ray.d = vload3(2 * i + 1, in0);
    Span span;
    out0[i] = medium_span(scene->media, ray, 0.0f, INFINITY, &span) ? span.end - span.start : 0.0f;
"""


def rays_along(lower, upper, tilt=0.0):
    """Rays along every axis, both ways, at each pair of places across.

    Returns origins, directions, and whether each runs through the box by the rule.
    """
    rays, through = [], []
    for axis, way, places in itertools.product(range(3), (1, -1), itertools.product(PLACES, repeat=2)):
        across = [a for a in range(3) if a != axis]
        origin, direction = np.zeros(3), np.zeros(3)
        direction[axis], direction[across[0]] = way, tilt
        origin[axis] = lower[axis] - 1 if way > 0 else upper[axis] + 1
        for a, place in zip(across, places, strict=True):
            origin[a] = lower[a] + PLACES[place] * (upper[a] - lower[a]) if place != "upper" else upper[a]
        rays.append((origin, direction, upper[axis] - lower[axis]))
        through.append("upper" not in places)
    return *(np.array(column) for column in zip(*rays, strict=True)), np.array(through)


def lengths(device, scene, origins, directions):
    probe = Probe(device, scene, transmittance="regular")
    rays = np.stack([origins - probe.prepared.centre, directions], axis=1).astype(np.float32)
    headers = [*headers_of(probe.plan, "transmittance"), "geometry/span.h"]
    return probe.run(headers, SPANS, (np.zeros(len(rays), np.float32),), (rays,))[0]


@pytest.mark.parametrize("kind", ["homogeneous", "grid"])
@pytest.mark.parametrize("name", BOXES)
def test_a_lower_face_counts_and_an_upper_does_not(device, name, kind):
    """All of the ray or none of it, also where rounding has turned the ray by a hair."""
    lower, upper = (np.array(corner) for corner in BOXES[name])
    grid = volume(np.random.default_rng(1).random((5, 6, 7)) + 0.5, lower, upper)
    medium = gridded(grid) if kind == "grid" else homogeneous(1.0)
    scene = picture([box(lower, upper, medium)], [SKY], (0, 0, -9), (0, 0, 0))
    for tilt in (0.0, 1e-8, -1e-8):
        origins, directions, whole, through = rays_along(lower, upper, tilt)
        found = lengths(device, scene, origins, directions)
        np.testing.assert_allclose(found, np.where(through, whole, 0.0), rtol=1e-5)


def test_boxes_side_by_side_share_no_ray_and_lose_none(device):
    """A ray in the face between two boxes is in one of them."""
    total = 0.0
    for lower, upper in (((0.1, 0.2, 0.3), (0.4, 0.9, 0.8)), ((0.4, 0.2, 0.3), (0.7, 0.9, 0.8))):
        scene = picture([box(lower, upper, homogeneous(1.0))], [SKY], (0, 0, -9), (0, 0, 0))
        origin, direction = np.array([[0.4, 0.5, -1.0]]), np.array([[0.0, 0.0, 1.0]])
        total += lengths(device, scene, origin, direction)[0]
    assert total == pytest.approx(0.5, rel=1e-5)


WALKS = {"ratio": "grid", "residual-ratio": "kdtree", "power-series": "global", "regular": "grid"}
INSIDE_PLANE = ((0.5, 0.25, 0.0), (0.0, 0.0, 1.0))  # between two cells of samples, and of majorants
LOWER_FACE = ((0.0, 0.3, 1.0), (0.0, 0.0, -1.0))
LOWER_EDGE = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize("transmittance", WALKS)
def test_all_walks_see_the_same_in_a_face(device, transmittance):
    """The density on the face, whatever cells are walked: as if the border went on outside."""
    values = np.random.default_rng(2).random((8, 8, 8)).astype(np.float32) + 0.5
    probe = Probe(
        device,
        scene_of(medium_of(values, 2.0, 0.5)),
        transmittance=transmittance,
        majorant=WALKS[transmittance],
    )
    for number, ray in enumerate((INSIDE_PLANE, LOWER_FACE, LOWER_EDGE)):
        origin, direction = (np.array(part) for part in ray)
        exact = np.exp(-optical_depth(values, origin, direction, 1.0, 2.0)[-1])
        estimates, flaws, _ = transmittance_walks(probe, (origin, direction), 1.0, 1 << 16, seed=number)
        assert flaws.sum() == 0
        error = estimates.std() / np.sqrt(len(estimates)) + 1e-5
        assert abs(estimates.mean() - exact) < largest_z(3 * len(WALKS)) * error
