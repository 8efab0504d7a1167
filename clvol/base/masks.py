"""Masked arrays (`numpy.ma`): what is masked has no value, though NumPy converts it to what lies there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def as_array(value: ArrayLike) -> np.ndarray:
    """As `numpy.asarray`, but the masks of a masked array, or of a list of them, are kept."""
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(isinstance(part, np.ma.MaskedArray) for part in parts):
        return np.ma.array(value, copy=False)
    return np.asarray(value)


def masked_count(value: ArrayLike) -> int:
    """How many elements of an array, or of a list of arrays, are masked; 0 for what has no masks."""
    return int(np.count_nonzero(np.ma.getmaskarray(as_array(value))))
