"""Types that rooms share.

Arrays are annotated `np.ndarray` everywhere: dtype, shape and unit stand in docstrings and in the comments of
fields, which say more than NumPy's own types can.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, SupportsInt

if TYPE_CHECKING:
    from collections.abc import Iterable


def triple(values: Iterable[SupportsInt]) -> tuple[int, int, int]:
    """Three whole numbers, one for each axis, as a tuple."""
    first, second, third = values
    return int(first), int(second), int(third)
