"""How the samples of a picture are cut into ranges, and the tree that their sums are added in.

Both follow from the picture alone, not from who renders it: so do the bits.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from clvol.picture.parts import FAN_IN
from clvol.rendering.session import MAX_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

LEAST_RANGES = 64
"""A picture has at least so many ranges, if it has as many samples of a pixel, and enough over all pixels."""
MOST_RANGES = 1 << 14
LEAST_PATHS = 1 << 20
"""A range has at least so many samples over all pixels: each costs as much as some 35,000 beside."""
RANGE_PATHS = 1 << 24
"""A range has about so many samples over all pixels: some ten seconds of a processor, one of a large GPU."""

_Sum = TypeVar("_Sum")


def range_length(count: int, pixels: int) -> int:
    """Samples of a pixel in each range, but the last, of a picture with `count` of them."""
    usual = max(1, RANGE_PATHS // pixels)
    if count >= MAX_SAMPLES // 2:  # without an end
        return usual
    least = min(max(-(-LEAST_PATHS // pixels), -(-count // LEAST_RANGES)), count)
    return max(-(-count // MOST_RANGES), min(least, usual))


def sample_ranges(first: int, count: int, pixels: int) -> Iterator[tuple[int, int]]:
    """Ranges (first, count) that make up the samples `first` to `first + count`."""
    length, end = range_length(count, pixels), first + count
    for start in range(first, end, length):
        yield start, min(length, end - start)


class Tree(Generic[_Sum]):
    """Sums of numbered ranges, added `FAN_IN` neighbours at a time, as `clvol.picture.parts.added` does.

    Parameters
    ----------
    add : makes one sum of several.
    """

    def __init__(self, add: Callable[[list[_Sum]], _Sum]) -> None:
        self._add = add
        self._sums: dict[tuple[int, int], _Sum] = {}  # by level and place: those that are in no other

    def put(self, number: int, leaf: _Sum) -> None:
        """The sum of range `number`."""
        self._put(0, number, leaf)

    def _put(self, level: int, place: int, one: _Sum) -> None:
        self._sums[level, place] = one
        group = [(level, n) for n in range(place // FAN_IN * FAN_IN, (place // FAN_IN + 1) * FAN_IN)]
        if all(key in self._sums for key in group):
            self._put(level + 1, place // FAN_IN, self._add([self._sums.pop(key) for key in group]))

    def tops(self) -> list[_Sum]:
        """What is to be added yet, in the order of samples."""
        return [self._sums[key] for key in sorted(self._sums, key=_start)]

    def root(self) -> _Sum:
        """The sum of all, the tree's last groups not being full; ranges may lack."""
        sums = dict(self._sums)
        level = 0
        while len(sums) > 1:
            groups: dict[int, list[int]] = {}
            for place in sorted(place for at, place in sums if at == level):
                groups.setdefault(place // FAN_IN, []).append(place)
            for group, places in groups.items():
                parts = [sums.pop((level, place)) for place in places]
                sums[level + 1, group] = parts[0] if len(parts) == 1 else self._add(parts)
            level += 1
        return next(iter(sums.values()))

    def lost(self, gone: Callable[[_Sum], bool]) -> list[range]:
        """Forget the sums that are `gone`: the numbers of the ranges that they were of."""
        keys = [key for key, one in self._sums.items() if gone(one)]
        for key in keys:
            del self._sums[key]
        return [range(place * FAN_IN**level, (place + 1) * FAN_IN**level) for level, place in sorted(keys)]


def _start(key: tuple[int, int]) -> int:
    level, place = key
    return place * int(FAN_IN**level)
