"""Errors a user can cause: each says what is wrong, where, and what to do about it.

What to do is said in the words of where the user is: of Python, of the command line or of a scene's file.
`option`, `parameter` and `either` write what differs between them, and `Told` is text that has all forms.
"""

from __future__ import annotations

import re
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


_START, _NEXT, _END = "\ue000", "\ue001", "\ue002"
"""Round what differs, and between its forms: code points that no text has."""
_DIFFERS = re.compile(f"{_START}([^{_START}{_END}]*){_END}")
_COMMAND = {"time_limit": "--time", "checkpoint_every": "--every"}
"""Options that the command line calls otherwise than Python."""


def either(python: str, command: str) -> str:
    """A part of a message that is one thing in Python and another on the command line."""
    return f"{_START}{python}{_NEXT}{command}{_END}"


def option(name: str, value: object = "") -> str:
    """An option of a Python function that the command line has too, perhaps with a value to give."""
    spelled = _COMMAND.get(name, f"--{name.replace('_', '-')}")
    if isinstance(value, str) and not value:
        return either(name, spelled)
    quoted = f'"{value}"' if isinstance(value, str) else repr(value)
    return either(f"{name}={quoted}", spelled if value is True else f"{spelled} {value}")


def parameter(name: str, value: bool | str = "") -> str:
    """An option of a volume, which is a parameter of its plugin where a scene's file names it."""
    tag, text = ("boolean", str(value).lower()) if isinstance(value, bool) else ("string", value)
    element = f'<{tag} name="{name}" value="{text}"/>' if text else name
    return f"{option(name, value)[:-1]}{_NEXT}{element}{_END}"


GRID = either("grid", "--density (clvol info: --grid)")
"""How a grid of a file is chosen; `clvol info` calls it --grid."""


class Told(str):
    """Text in the form of Python, `marked` with the others."""

    marked: str

    def __new__(cls, marked: str, longest: int = sys.maxsize) -> Told:
        """Of text with parts of `either`, `option` and `parameter`; each form is shortened to `longest`."""
        marked = getattr(marked, "marked", marked)
        made = super().__new__(cls, shortened(_spelled(marked), longest))
        made.marked = marked
        return made


def spelled_out(text: str, command: bool = False, in_scene: bool = False, longest: int = sys.maxsize) -> str:
    """Text as the command line or Python has it, and of parameters a scene's file."""
    return shortened(_spelled(getattr(text, "marked", text), command, in_scene), longest)


def _spelled(marked: str, command: bool = False, in_scene: bool = False) -> str:
    def one(found: re.Match[str]) -> str:
        forms = found[1].split(_NEXT)
        return forms[2] if in_scene and len(forms) > 2 else forms[min(command, len(forms) - 1)]

    return _DIFFERS.sub(one, marked)


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
    whole = False
    """Whether the message has several lines that are to stay so."""
    in_scene = False
    """Whether it is about what a scene's file says."""

    def __init__(self, what: str, where: str = "", hint: str = "") -> None:
        self.what, self.where, self.hint = (Told(part, self.longest) for part in (what, where, hint))
        super().__init__(self.told())

    def told(self, command: bool = False) -> str:
        """The message in one line, in the words of Python or of the command line.

        What files and callers gave may hold anything: it shows as escapes where it would command a terminal.
        """
        what, where, hint = (
            spelled_out(part, command, self.in_scene, self.longest)
            for part in (self.what, self.where, self.hint)
        )
        text = "; ".join(filter(None, (f"{where}: {what}" if where else what, hint)))
        return text if self.whole else "\n".join(map(printable, text.split("\n")))

    def __str__(self) -> str:
        return self.told()


class SceneError(Error):
    """A scene description that cannot be understood or is not supported."""


class VolumeError(Error):
    """A volume file or array that is broken, hostile, or not a valid coefficient field."""


class DeviceError(Error):
    """No usable OpenCL device, or a kernel that does not build on it (with the whole log)."""

    longest = sys.maxsize
    whole = True


class RenderError(Error):
    """A render that was to end before it had a picture."""


class OptionError(Error):
    """A choice (technique, majorant, sample count, …) that is unknown or impossible."""


class UnknownOptionError(OptionError, TypeError):
    """A keyword that a function does not know: what Python says with a TypeError."""
