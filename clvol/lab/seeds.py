"""Seeds of renders that must be independent of each other, and of the user's picture."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator


def independent_seeds(seed: int, purpose: str) -> Iterator[int]:
    """64-bit seeds, none of them `seed` itself: of each `seed` and `purpose` others."""
    words = np.random.SeedSequence([seed, *purpose.encode()])
    while True:
        (words,), drawn = words.spawn(1), words
        found = int(drawn.generate_state(1, np.uint64)[0])
        if found != seed:
            yield found


def seeds_from(seed: int, taken: tuple[int, int] | None = None) -> Iterator[int]:
    """64-bit seeds counting up from `seed`, without those taken, from the first to the last."""
    counted: Iterator[int] = itertools.count(seed)
    if taken is not None and seed <= taken[1]:
        seed = max(seed, taken[1] + 1) if seed >= taken[0] else seed
        before = itertools.takewhile(lambda n: n < taken[0], itertools.count(seed))
        counted = itertools.chain(before, itertools.count(max(seed, taken[1] + 1)))
    return (n % 2**64 for n in counted)
