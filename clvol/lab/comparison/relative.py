"""What errors are relative to."""

from __future__ import annotations

import numpy as np

DARK = 0.1
"""Relative errors are of F² + (DARK · mean of F)²: radiance far below the mean does not count for more."""


def relative_weight(reference: np.ndarray) -> np.ndarray:
    """1 / (F² + (DARK · mean F)²), what makes a squared error relative; 1 for a black picture."""
    floor = (DARK * float(np.abs(reference).mean())) ** 2
    return 1.0 / (reference**2 + floor) if floor > 0 else np.ones_like(reference)


def level(reference: np.ndarray) -> np.ndarray:
    """What the error of a pixel is relative to, (height, width): sqrt(F² + (DARK · mean F)²) of its grey."""
    found: np.ndarray = 1.0 / np.sqrt(relative_weight(reference.mean(axis=-1)))
    return found
