"""What is framed is in the picture, and as large as fits."""

from __future__ import annotations

import numpy as np
import pytest

from clvol.staging.coarse import extremes
from clvol.staging.framing import MARGIN, Axes, frame, half_tangents
from clvol.staging.options import VIEWS

POINTS = np.random.default_rng(3).normal(size=(40, 3)) * [1.0, 3.0, 0.4] + [5.0, -2.0, 8.0]


def in_picture(points: np.ndarray, to_world: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Places of points in the picture, -1 to 1 from edge to edge, x to the right and y up."""
    local = (points - to_world[:3, 3]) @ to_world[:3, :3]
    assert (local[:, 2] > 0).all()
    seen: np.ndarray = local[:, :2] / local[:, 2:] / half_tangents(*size) * [-1, 1]
    return seen


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("size", [(64, 64), (160, 90), (30, 90)])
def test_points_fill_the_picture_but_for_the_margin(up: str, view: str, size: tuple[int, int]) -> None:
    camera = frame(POINTS, Axes.of(up), *VIEWS[view], size)
    seen = in_picture(POINTS, camera.to_world, size)
    room = 1 - 2 * MARGIN
    assert np.abs(seen).max() == pytest.approx(room, rel=1e-6)
    widest = np.abs(seen).max(axis=0).argmax()  # its ends are as far from either edge
    assert seen[:, widest].min() == pytest.approx(-seen[:, widest].max(), rel=1e-6)


@pytest.mark.parametrize(("up", "front"), [("y", [0, 0, 1]), ("z", [0, -1, 0])])
def test_views_look_from_where_they_say(up: str, front: list[float]) -> None:
    axes, right = Axes.of(up), np.array([1.0, 0, 0])
    above = np.eye(3)["xyz".index(up)]
    expected = {"front": front, "back": [-one for one in front], "right": right, "left": -right, "top": above}
    for name, place in expected.items():
        camera = frame(POINTS - POINTS.mean(axis=0), axes, *VIEWS[name], (64, 64)).to_world
        np.testing.assert_allclose(-camera[:3, 2], place, atol=1e-12)
        picture_up = above if name != "top" else -np.array(front)
        np.testing.assert_allclose(camera[:3, 1], picture_up, atol=1e-12)


def test_from_the_front_what_is_right_is_to_the_right() -> None:
    for up in "yz":
        axes = Axes.of(up)
        points = np.stack([axes.right, -axes.right, axes.up])
        seen = in_picture(points, frame(points, axes, 0, 0, (64, 64)).to_world, (64, 64))
        assert seen[0, 0] > 0 > seen[1, 0] and seen[2, 1] > 0


def test_a_factor_moves_the_camera_closer() -> None:
    axes = Axes.of("y")
    near, far = (frame(POINTS, axes, 30, 10, (64, 64), factor) for factor in (0.5, 1.0))
    assert near.distance == pytest.approx(far.distance / 2)


def test_few_points_stand_for_many() -> None:
    points = np.random.default_rng(0).normal(size=(5000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    few = extremes(points)
    assert len(few) < 300
    axes = Axes.of("z")
    of_all, of_few = (frame(some, axes, 20, 30, (64, 64)).distance for some in (points, few))
    assert of_few == pytest.approx(of_all, rel=0.02)
