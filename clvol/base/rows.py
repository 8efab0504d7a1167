"""Pictures by bands of rows, so that what is worked out of them needs no second copy of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

CHUNK_PIXELS = 1 << 18


def bands(height: int, width: int) -> Iterator[slice]:
    """The rows of a picture, in slices of about CHUNK_PIXELS pixels, at least a row each."""
    step = max(1, CHUNK_PIXELS // width)
    for first in range(0, height, step):
        yield slice(first, min(first + step, height))
