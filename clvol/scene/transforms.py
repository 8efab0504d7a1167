"""4x4 matrices that map column vectors from local to world space, composed with ``@``.

They are plain float64 arrays; anything with a 4x4 ``.matrix`` (as ``mi.ScalarTransform4f``) serves as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.masks import as_array
from clvol.errors import SceneError, shown

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SMALLEST, LARGEST = 1e-18, 1e18
"""Sizes that can be rendered: their squares are floats."""


def translate(v: ArrayLike) -> np.ndarray:
    """Translation.

    Parameters
    ----------
    v
        World units along x, y and z; or one number for all axes.

    Returns
    -------
    numpy.ndarray
        float64 (4, 4).

    Raises
    ------
    SceneError
        Not three finite numbers.
    """
    matrix = np.eye(4)
    matrix[:3, 3] = _vector(v, "translate")
    return matrix


def scale(v: ArrayLike) -> np.ndarray:
    """Scaling about the origin.

    Parameters
    ----------
    v
        Factors along x, y and z; or one for all axes.

    Returns
    -------
    numpy.ndarray
        float64 (4, 4).

    Raises
    ------
    SceneError
        Not three finite numbers.
    """
    return np.diag([*_vector(v, "scale"), 1.0])


def rotate(axis: ArrayLike, angle_degrees: float) -> np.ndarray:
    """Rotation about an axis through the origin, counter-clockwise for an eye the axis points at.

    Parameters
    ----------
    axis
        Three numbers, of any length but zero (Mitsuba does not normalise it, and then does not rotate).
    angle_degrees
        Angle in degrees.

    Returns
    -------
    numpy.ndarray
        float64 (4, 4).

    Raises
    ------
    SceneError
        An axis of length zero, or what is no finite number.
    """
    direction = _vector(axis, "rotate: axis")
    length = np.linalg.norm(direction)
    if length == 0:
        raise SceneError("rotate: the axis is zero", hint="give a direction such as (0, 1, 0)")
    x, y, z = direction / length
    angle = np.deg2rad(_number(angle_degrees, "rotate: angle"))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    # Rodrigues' formula.
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    return matrix


def look_at(origin: ArrayLike, target: ArrayLike, up: ArrayLike) -> np.ndarray:
    """Camera-to-world matrix at `origin` with local +z towards `target` and local +y near `up`.

    The columns are left (up x dir), up, dir, origin, as in Mitsuba: local +x is the image's left.

    Parameters
    ----------
    origin, target
        World positions, three numbers each.
    up
        A direction in the world, of any length but zero.

    Returns
    -------
    numpy.ndarray
        float64 (4, 4).

    Raises
    ------
    SceneError
        When origin and target coincide, or `up` is zero or parallel to the view direction.
    """
    eye, to, above = (
        _vector(v, f"look_at: {name}") for v, name in ((origin, "origin"), (target, "target"), (up, "up"))
    )
    distance = np.linalg.norm(to - eye)
    if distance == 0:
        raise SceneError("look_at: origin and target are the same point")
    forward = (to - eye) / distance
    left = np.cross(above, forward)
    length = np.linalg.norm(left)
    if length <= 1e-9 * np.linalg.norm(above):
        raise SceneError(
            "look_at: up is zero or parallel to the view direction", hint="choose another up vector"
        )
    left /= length
    matrix = np.eye(4)
    matrix[:3] = np.stack([left, np.cross(forward, left), forward, eye], axis=1)
    return matrix


def frame(z: np.ndarray) -> np.ndarray:
    """Rotation that turns local +z onto the unit vector `z`, 4x4 (Duff et al. 2017).

    The other axes lie where Mitsuba's `coordinate_system` has them.
    """
    sign = np.copysign(1.0, z[2])
    a = -1 / (sign + z[2])
    b = z[0] * z[1] * a
    matrix = np.eye(4)
    matrix[:3, 0] = 1 + sign * z[0] ** 2 * a, sign * b, -sign * z[0]
    matrix[:3, 1] = b, sign + z[1] ** 2 * a, -z[1]
    matrix[:3, 2] = z
    return matrix


def any_up(origin: ArrayLike, target: ArrayLike) -> np.ndarray:
    """The `up` of a view that names none, as Mitsuba takes it, float64 (3,)."""
    ahead = _vector(target, "look_at: target") - _vector(origin, "look_at: origin")
    length = np.linalg.norm(ahead)
    up: np.ndarray = frame(ahead / length)[:3, 0] if length > 0 else np.array([0.0, 1.0, 0.0])
    return up


def as_matrix(value: Any) -> np.ndarray:
    """`value` (4x4 array, or an object with a 4x4 ``.matrix``) as an invertible, affine float64 matrix.

    Raises
    ------
    SceneError
        Not a 4x4 matrix of finite numbers, a last row other than 0 0 0 1, or singular.
    """
    matrix = _numbers(getattr(value, "matrix", value))
    if matrix.shape != (4, 4):
        raise SceneError(
            "expected a transform: a 4x4 array, or an object with a 4x4 .matrix",
            hint="clvol.look_at, translate, scale and rotate make them",
        )
    if not np.isfinite(matrix).all():
        raise SceneError("the transform is not finite")
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise SceneError("the transform's last row must be 0 0 0 1 (no projections)")
    check_size(matrix)
    singular_values = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    if singular_values[-1] <= 1e-12 * singular_values[0]:
        raise SceneError("the transform is singular: it flattens space", hint="look for a scale factor of 0")
    return matrix


def check_size(matrix: np.ndarray) -> None:
    """Raise SceneError for a 4x4 transform to sizes or places that single precision does not hold."""
    with np.errstate(over="ignore", under="ignore"):
        size = np.abs(matrix[:3, :3]).max()
    if not (SMALLEST <= size <= LARGEST and np.abs(matrix[:3, 3]).max() <= LARGEST):
        raise SceneError(
            f"the transform scales by {size:.3g} and moves by {np.abs(matrix[:3, 3]).max():.3g}",
            hint=f"{SMALLEST:g} to {LARGEST:g} can be rendered: take another unit of length",
        )


def _numbers(value: ArrayLike) -> np.ndarray:
    """A float64 copy, NaN where elements are masked; empty where there are no numbers."""
    try:
        array = as_array(value)
        if array.dtype == bool:
            return np.empty(0)
        return np.ma.filled(np.ma.array(array, np.float64, copy=True), np.nan)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def _vector(value: ArrayLike, what: str) -> np.ndarray:
    vector = _numbers(value)
    if vector.shape == ():
        vector = np.full(3, vector)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise SceneError(f"{what}: expected three finite numbers, got {shown(value)}")
    return vector


def _number(value: float, what: str) -> float:
    try:
        number = np.nan if isinstance(value, bool | np.bool_) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not np.isfinite(number):
        raise SceneError(f"{what}: expected a finite number, got {shown(value)}")
    return number


def stays_round(matrix: np.ndarray) -> bool:
    """Whether a 4x4 transform keeps circles round z circles, and z across them."""
    gram = matrix[:3, :3].T @ matrix[:3, :3]
    return bool(np.allclose(gram, np.diag(np.diag(gram)[[0, 0, 2]]), atol=1e-4 * gram.max()))


def keeps_angles(matrix: np.ndarray) -> bool:
    """Whether a 4x4 transform rotates, mirrors and scales all axes alike, and nothing else."""
    gram = matrix[:3, :3].T @ matrix[:3, :3]
    return bool(np.allclose(gram / gram[0, 0], np.eye(3), atol=1e-4))
