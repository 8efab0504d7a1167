"""Colours as three numbers, and their luminance.  Linear sRGB throughout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.base.rows import bands

if TYPE_CHECKING:
    from collections.abc import Sequence

LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
"""Rec. 709, of red, green and blue."""


def rgb(value: Sequence[float] | float) -> np.ndarray:
    """One number or three as three, float64 (3,)."""
    return np.broadcast_to(np.asarray(value, np.float64), 3)


def luminance(colours: np.ndarray) -> np.ndarray:
    """Luminance of colours, float (..., 3)."""
    found: np.ndarray = colours @ LUMINANCE
    return found


def mean_luminance(picture: np.ndarray) -> float:
    """Mean luminance of a picture, float (h, w, 3)."""
    height, width, _ = picture.shape
    total = sum(float(luminance(picture[rows]).sum()) for rows in bands(height, width))
    return float(total / (height * width))
