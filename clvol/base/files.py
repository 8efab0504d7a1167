"""Opening the files that users name: regular files only, so that no pipe, socket or device is waited for.

What is read for a scene is noted on the way, so that no picture replaces it.
"""

from __future__ import annotations

import os
import stat
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from io import BufferedReader

    from clvol.errors import Error

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
# Opening a pipe that nobody writes to waits for ever otherwise; not every system has these.
_FLAGS = sum(getattr(os, name, 0) for name in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY"))


def other_kind(path: str | os.PathLike[str]) -> str:
    """What stands at `path` in place of a regular file, as "a folder"; "" for a file, and for nothing."""
    try:
        return _kind(os.stat(path).st_mode)
    except (OSError, ValueError):
        return ""


def _kind(mode: int) -> str:
    return "" if stat.S_ISREG(mode) else _KINDS.get(stat.S_IFMT(mode), "not a regular file")


_NOTED: ContextVar[dict[str, None] | None] = ContextVar("files that are read", default=None)


@contextmanager
def files_noted() -> Iterator[dict[str, None]]:
    """The names of all files that are read within the block, in their order."""
    outer, noted = _NOTED.get(), dict[str, None]()
    token = _NOTED.set(noted)
    try:
        yield noted
    finally:
        _NOTED.reset(token)
        if outer is not None:
            outer.update(noted)


def note_file(path: str | os.PathLike[str]) -> None:
    """Note that a file is read, where `open_regular` does not see it, as by another library."""
    noted = _NOTED.get()
    if noted is not None:
        noted[os.fspath(path)] = None


@contextmanager
def open_regular(path: str | os.PathLike[str], error: type[Error], noun: str) -> Iterator[BufferedReader]:
    """Open a regular file for reading bytes, and see to it that it does not change until it is closed.

    Parameters
    ----------
    error, noun : what is raised, and what it says the file should be, as "volume file": `path` is missing,
        no regular file or not readable; or another program wrote to it meanwhile.
    """
    kind = other_kind(path)
    if kind:
        raise error(f"is {kind}, not a {noun}", str(path))
    try:
        file = os.fdopen(os.open(path, os.O_RDONLY | _FLAGS), "rb")
    except FileNotFoundError:
        raise error("no such file", str(path)) from None
    except (OSError, ValueError) as reason:
        raise error(f"cannot be opened ({reason})", str(path)) from None
    note_file(path)
    with file:
        before = os.fstat(file.fileno())
        if _kind(before.st_mode):  # put in its place since
            raise error(f"is {_kind(before.st_mode)}, not a {noun}", str(path))
        yield file
        after = os.fstat(file.fileno())
        if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns):
            raise error("changed while it was read", str(path), "load it again once it is written")
