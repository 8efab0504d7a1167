"""Errors a user can cause: each says what is wrong, where, and what to do about it."""

from __future__ import annotations


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

    def __init__(self, what: str, where: str = "", hint: str = "") -> None:
        self.what, self.where, self.hint = what, where, hint
        parts = [f"{where}: {what}" if where else what]
        if hint:
            parts.append(hint)
        super().__init__("; ".join(parts))


class SceneError(Error):
    """A scene description that cannot be understood or is not supported."""


class VolumeError(Error):
    """A volume file or array that is broken, hostile, or not a valid coefficient field."""


class DeviceError(Error):
    """No usable OpenCL device, or a kernel that does not build on it."""


class OptionError(Error):
    """A choice (technique, majorant, sample count, …) that is unknown or impossible."""
