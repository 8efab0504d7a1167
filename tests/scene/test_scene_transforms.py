"""Transforms are Mitsuba's.  The matrices were printed by Mitsuba 3.9.1 (scalar_rgb, single precision)."""

import numpy as np
import pytest

from clvol.errors import SceneError
from clvol.scene import look_at, rotate, scale, translate
from clvol.scene.transforms import as_matrix

LOOK_AT = [
    [0.9880120158195496, -0.07811354100704193, -0.1331559121608734, 1.0],
    [0.0, 0.8625378608703613, -0.5059924721717834, 2.0],
    [0.15437687933444977, 0.4999266564846039, 0.8521978259086609, -3.0],
    [0.0, 0.0, 0.0, 1.0],
]


def test_look_at_is_mitsubas_matrix():
    np.testing.assert_allclose(look_at([1, 2, -3], [0.5, 0.1, 0.2], [0, 1, 0]), LOOK_AT, atol=2e-7)


def test_look_at_has_local_x_on_the_images_left():
    # Looking along -z with y up, the image's right is +x; so local +x, the left, is -x.
    np.testing.assert_allclose(look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])[:3, 0], [-1, 0, 0], atol=1e-15)


def test_rotate_turns_counter_clockwise_and_keeps_lengths_for_any_axis():
    np.testing.assert_allclose(rotate([0, 0, 2], 90) @ [1, 0, 0, 1], [0, 1, 0, 1], atol=1e-15)
    turn = rotate([1, 2, 3], 40)[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(turn @ [1, 2, 3], [1, 2, 3], atol=1e-14)
    assert np.isclose(np.trace(turn), 1 + 2 * np.cos(np.deg2rad(40)))


def test_matrices_compose_from_right_to_left():
    point = translate([1, 2, 3]) @ scale([4, 3, 2]) @ np.array([1, 1, 1, 1])
    np.testing.assert_array_equal(point, [5, 5, 5, 1])


@pytest.mark.parametrize(
    "call",
    [
        lambda: look_at([0, 0, 0], [0, 0, 0], [0, 1, 0]),
        lambda: look_at([0, 0, 0], [0, 1, 0], [0, 2, 0]),
        lambda: look_at([0, 0, 0], [0, 1, 0], [0, 0, 0]),
        lambda: rotate([0, 0, 0], 30),
        lambda: rotate([0, 1, 0], float("nan")),
        lambda: translate([1, 2]),
        lambda: scale("twice"),
        lambda: as_matrix(np.eye(3)),
        lambda: as_matrix(scale([1, 0, 1])),
        lambda: as_matrix(np.full((4, 4), np.nan)),
        lambda: as_matrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 1, 1]]),
        lambda: as_matrix("turned"),
    ],
)
def test_impossible_transforms_are_errors(call):
    with pytest.raises(SceneError):
        call()


def test_an_object_with_a_matrix_is_a_transform():
    class Transform:
        matrix = np.diag([2.0, 2.0, 2.0, 1.0]).astype(np.float32)

    np.testing.assert_array_equal(as_matrix(Transform()), scale(2))
