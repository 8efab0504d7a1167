"""Numbers of any type as float32, which the device computes with; those that it cannot hold are an error."""

from __future__ import annotations

import numpy as np

from clvol.errors import VolumeError

LARGEST, SMALLEST = float(np.finfo(np.float32).max), float(np.finfo(np.float32).tiny)
"""Sizes that a float32 may have: below the smallest normal one devices take it as 0."""


class Narrowing:
    """The samples of one volume, in parts of any shape.

    NaN and infinity stay, for the checks to count.  A finite number beyond float32 is an error at once, and
    numbers all of which are nothing in it are one at the end (`check`); that some are, beside others, is not.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self._something = False
        self._peak = 0.0  # of those that are nothing

    def __call__(self, numbers: np.ndarray) -> np.ndarray:
        """The numbers as float32, the same array where they are; VolumeError where one is beyond."""
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            narrowed = numbers.astype(np.float32, copy=False)
        if numbers.dtype.kind != "f" or numbers.dtype.itemsize <= narrowed.dtype.itemsize:
            self._something = True
            return narrowed
        if np.isinf(narrowed).any():
            peak = float(np.abs(numbers).max(where=np.isfinite(numbers), initial=0.0))
            if peak > LARGEST:
                what = f"has values up to {peak:.3g}, beyond single precision ({LARGEST:.2g})"
                raise VolumeError(what, self.where, "scale the values down")
        if not self._something:
            self._something = bool((np.abs(narrowed) >= SMALLEST).any())
            peak = float(np.abs(numbers).max(where=np.isfinite(numbers), initial=0.0))
            self._peak = max(self._peak, peak)
        return narrowed

    def check(self) -> None:
        """VolumeError where there were numbers other than 0, and float32 has nothing but 0 for them."""
        if not self._something and self._peak > 0:
            raise vanishing(self._peak, self.where)


def vanishing(peak: float, where: str) -> VolumeError:
    """The error about values that are nothing, the greatest of them `peak`."""
    what = f"has no value above {peak:.3g}, which is 0 in single precision (from {SMALLEST:.2g} on)"
    return VolumeError(what, where, "scale the values up")
