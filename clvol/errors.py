"""Errors a user can cause: each says what is wrong, where, and what to do about it."""

from __future__ import annotations

import sys

LONGEST = 1000
"""Characters that each part of a message has at most: of what a file or a caller gave, its ends are shown."""


def shortened(text: str, longest: int = LONGEST) -> str:
    """`text`, with its middle left out where it is longer than `longest`."""
    if len(text) <= longest:
        return text
    head = (longest - 1) * 2 // 3
    return f"{text[:head]}…{text[head + 1 - longest :]}"


def printable(text: str) -> str:
    """The text with what would move the cursor, colour the terminal or turn the line round as escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: object, longest: int = 60) -> str:
    """A caller's value for a message: its `repr`, shortened, or its type where it has none."""
    try:
        return shortened(repr(value), longest)
    except Exception:  # a __repr__ that is not ours may raise anything
        return f"a {type(value).__name__}"


class Error(Exception):
    """Base of every error clvol raises for a user's mistake (the command line exits with 2).

    Parameters
    ----------
    what : str
        What is wrong, in one sentence that names the offending thing.
    where : str, optional
        File and line, grid, plugin or parameter it was found at.
    hint : str, optional
        What to do about it.
    """

    longest = LONGEST

    def __init__(self, what: str, where: str = "", hint: str = "") -> None:
        self.what, self.where, self.hint = (shortened(part, self.longest) for part in (what, where, hint))
        parts = [f"{self.where}: {self.what}" if where else self.what]
        if hint:
            parts.append(self.hint)
        super().__init__("; ".join(parts))


class SceneError(Error):
    """A scene description that cannot be understood or is not supported."""


class VolumeError(Error):
    """A volume file or array that is broken, hostile, or not a valid coefficient field."""


class DeviceError(Error):
    """No usable OpenCL device, or a kernel that does not build on it (with the whole log)."""

    longest = sys.maxsize


class RenderError(Error):
    """A render that was to end before it had a picture."""


class OptionError(Error):
    """A choice (technique, majorant, sample count, …) that is unknown or impossible."""


class UnknownOptionError(OptionError, TypeError):
    """A keyword that a function does not know: what Python says with a TypeError."""
