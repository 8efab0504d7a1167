"""Affine maps as the device has them: relative to the scene's centre, which is subtracted in double."""

from __future__ import annotations

import numpy as np


def centred(to_world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """A 4x4 map to the world as one to positions relative to `centre`, float64 (3,)."""
    matrix = to_world.copy()
    matrix[:3, 3] -= centre
    return matrix


def from_centred(to_world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Its inverse: from positions relative to `centre`."""
    return np.linalg.inv(centred(to_world, centre))


def rows_3x4(matrix: np.ndarray) -> np.ndarray:
    """The affine part of a 4x4 (or the whole of a 3x4) matrix as 12 floats."""
    return matrix[:3].astype(np.float32).reshape(12)


def rotation_3x4(rotation: np.ndarray) -> np.ndarray:
    """A 3x3 matrix, which moves nothing, as 12 floats."""
    return rows_3x4(np.column_stack([rotation, np.zeros(3)]))
