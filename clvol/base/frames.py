"""Numbered files: patterns of names such as smoke.####.vdb, and lists of frames such as 1-100:2."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from clvol.errors import OptionError, shown

_PLACE = re.compile(r"#+|%(?:0(\d{1,2}))?d")
MOST = 100_000
"""Frames that a list may name."""


@dataclass(frozen=True)
class Pattern:
    """A name with one place for a number: of so many digits at least, with zeros before it.

    `before` and `after` are what stands round the place.
    """

    before: str
    digits: int
    after: str

    @classmethod
    def of(cls, name: str) -> Pattern | None:
        """The pattern that a name is: ####, %04d or %d stand for the number in the last part of a path.

        None for a name without a place, and for that of a file that is there.  OptionError for two places.
        """
        last = name.rpartition("/")[2]
        places = list(_PLACE.finditer(last))
        if not places or os.path.lexists(name):
            return None
        if len(places) > 1:
            raise OptionError(
                "has more than one place for a frame's number", name, "keep one, as in smoke.####.vdb"
            )
        [place] = places
        digits = len(place[0]) if place[0].startswith("#") else int(place[1] or 1)
        start = len(name) - len(last)
        return cls(name[: start + place.start()], digits, last[place.end() :])

    def at(self, frame: int) -> str:
        """The name of a frame."""
        return f"{self.before}{frame:0{self.digits}d}{self.after}"

    def found(self) -> list[int]:
        """Numbers of the files that there are, ascending."""
        folder, _, start = self.before.rpartition("/")
        numbered = re.compile(rf"{re.escape(start)}(\d{{{self.digits},}}){re.escape(self.after)}")
        place = Path(folder or ("/" if self.before.startswith("/") else "."))
        try:
            names = os.listdir(place)
        except OSError as error:
            raise OptionError(f"no frames: '{place}' cannot be read ({error.strerror})", str(self)) from None
        numbers = {int(match[1]) for name in names if (match := numbered.fullmatch(name))}
        return sorted(frame for frame in numbers if os.path.basename(self.at(frame)) in names)

    def __str__(self) -> str:
        return f"{self.before}{'#' * self.digits}{self.after}"


def parse_frames(text: str) -> list[int]:
    """Frames of a list as "1-100:2,205": single ones, ranges, ranges with steps; in its order, each once.

    Raises OptionError for anything else.
    """
    frames: dict[int, None] = {}
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d{1,9})(?:-(\d{1,9})(?::(\d{1,9}))?)?\s*", part)
        if not found:
            raise OptionError(
                f"frames {shown(text)} cannot be understood", hint="write them as 1-100:2 or 1,5,7"
            )
        first, last, step = int(found[1]), int(found[2] or found[1]), int(found[3] or 1)
        if step == 0 or last < first:
            raise OptionError(
                f"frames {shown(part.strip())} are none", hint="a range ascends, in steps from 1 on"
            )
        if len(frames) + (last - first) // step >= MOST:
            raise OptionError(f"frames {shown(text)} are more than {MOST:,}")
        frames |= dict.fromkeys(range(first, last + 1, step))
    return list(frames)
