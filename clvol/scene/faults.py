"""What is wrong with a scene: found one by one while reading goes on, told together.

What is not supported can be left out instead: `skip_unsupported`.
"""

from __future__ import annotations

import logging
import re
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from clvol.errors import Error, SceneError, Told, either, spelled_out

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

log = logging.getLogger("clvol")

MOST = 200
"""Faults after which reading ends: files can have as many as they have bytes."""
MOST_SKIPPED = 10_000
"""As `MOST`, of parts that are to be left out."""
_PLACE = re.compile(r"(.*):(\d{1,9})", re.DOTALL)
_skips: ContextVar[bool] = ContextVar("skips", default=False)


class UnsupportedError(SceneError):
    """A plugin, parameter or element that clvol does not know or does not render: it can be left out."""


class MissingFileError(SceneError):
    """A file or folder that a scene names and that is not there."""


class LostError(SceneError):
    """A plugin that is not there because of another fault, which has been noted."""


class FaultyError(SceneError):
    """Several faults of a scene, in `errors`; the message has a line for each."""

    whole = True

    def __init__(self, errors: Sequence[Error]) -> None:
        self.errors = tuple(sorted(errors, key=_by_place(errors)))
        more = "or more " if len(errors) >= MOST else ""
        unsupported = sum(isinstance(error, UnsupportedError) for error in errors)
        these = "these" if unsupported == len(errors) else f"the {unsupported} that are not supported"
        leave_out = either("with clvol.skip_unsupported(): loads the scene", "--skip-unsupported renders")
        hint = f"{leave_out} without {these}" if unsupported else ""
        super().__init__(f"{len(errors)} {more}faults in the scene", hint=hint)

    def told(self, command: bool = False) -> str:
        """A line for each; what there is to do stands once where it is the same."""
        lines, told = [], {""}
        for error in self.errors:
            line, hint = error.told(command), spelled_out(error.hint, command, error.in_scene, error.longest)
            line = line.removesuffix(f"; {hint}") if hint in told else line
            told.add(hint)
            lines.append("  " + " ".join(line.split()))
        head, _, hint = super().told(command).partition("; ")
        return "\n".join([f"{head}:", *lines, *filter(None, [hint])])


class EnoughError(Exception):
    """There are so many faults that reading ends; they are in `Faults`."""


class Faults:
    """Of one scene: `errors`, what was `left_out` instead if that is asked for, what is `approximated`."""

    def __init__(self) -> None:
        self.errors: list[Error] = []
        self.left_out: dict[Told, None] = {}  # in order
        self.approximated: dict[Told, None] = {}  # what is taken as something else, and as what, in order
        self.lost_ids: set[str] = set()  # of plugins that could not be read
        self.lost_file = False  # whether an included file, with whatever ids, could not be read
        self.skips = _skips.get()

    def __bool__(self) -> bool:
        """Whether there is anything that is not there because of a fault."""
        return bool(self.errors or self.left_out)

    def approximate(self, said: str, where: str) -> None:
        """Say that something is taken as something else: once in the log, with the first one's place."""
        told = Told(said)
        if told not in self.approximated:
            self.approximated[told] = None
            log.warning("%s: %s", where, told)

    def note(self, error: Error) -> None:
        """Go on without what the error is about.

        Raises
        ------
        EnoughError
            After too many.
        """
        if self.skips and isinstance(error, UnsupportedError):
            self._leave_out(error)
        elif not any((error.what, error.where) == (known.what, known.where) for known in self.errors):
            self.errors.append(error)
        if len(self.errors) >= MOST or len(self.left_out) >= MOST_SKIPPED:
            raise EnoughError

    def note_loss(self, what: str, where: str) -> None:
        """Go on without what other faults made useless."""
        if self.skips:
            self._leave_out(SceneError(f"{what} is left out with it", where))

    def _leave_out(self, error: Error) -> None:
        told = Told(f"{error.where}: {error.what}")
        if told not in self.left_out:
            self.left_out[told] = None
            log.warning("left out: %s", told)

    def check(self) -> None:
        """Raise what there is: the one error, or `FaultyError`."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise FaultyError(self.errors)


@contextmanager
def skip_unsupported() -> Iterator[None]:
    """Load scenes without what clvol does not support: ``with clvol.skip_unsupported(): scene = …``.

    Inside, `load_file`, `load_string` and `load_dict` leave out what they would refuse otherwise. The log,
    the scene's `left_out` and the metadata of its pictures name each part, with file and line.
    A shape without its BSDF has Mitsuba's default, one of an unknown type is not there, unknown parameters
    are ignored.  Mistakes and missing files stay errors.

    Parameters
    ----------
    None

    Raises
    ------
    SceneError
        Not here; by what is loaded inside, where too little is left, as no sensor.
    """
    token = _skips.set(True)
    try:
        yield
    finally:
        _skips.reset(token)


def _by_place(errors: Sequence[Error]) -> Callable[[Error], tuple[int, int]]:
    """A key that sorts by files, in order of appearance, then by lines."""
    files: dict[str, int] = {}
    for error in errors:
        files.setdefault(_file_and_line(error)[0], len(files))

    def key(error: Error) -> tuple[int, int]:
        file, line = _file_and_line(error)
        return files[file], line

    return key


def _file_and_line(error: Error) -> tuple[str, int]:
    found = _PLACE.fullmatch(error.where)
    return (found[1], int(found[2])) if found else (error.where, 0)
