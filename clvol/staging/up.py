"""Which axis of a volume points up, by what is known of who wrote it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from clvol.base.files import open_regular
from clvol.errors import VolumeError

if TYPE_CHECKING:
    from clvol.base.output_files import StrPath

_HEAD = 1 << 16
"""Bytes of a file that are looked at: OpenVDB has its metadata first."""
_WRITERS = {
    b"Houdini": ("y", "Houdini wrote it"),
    b"Blender": ("z", "Blender wrote it"),
    b"file_base_resolution": ("z", "Blender's fluid solver wrote it"),
}
_BY_FORMAT = {
    ".vdb": ("y", "usual for OpenVDB"),
    ".nvdb": ("y", "usual for OpenVDB"),
    ".vol": ("y", "usual for Mitsuba"),
}


def guess_up(path: StrPath | None) -> tuple[str, str]:
    """The axis, and why; arrays are taken to be [z, y, x] with z up."""
    if path is None:
        return "z", "usual for arrays [z, y, x]"
    suffix = Path(path).suffix.lower()
    if suffix in _BY_FORMAT and os.path.isfile(path):
        with open_regular(path, VolumeError, "volume file") as file:
            head = file.read(_HEAD)
        for name, found in _WRITERS.items():
            if name in head:
                return found
    return _BY_FORMAT.get(suffix, ("z", "usual for arrays [z, y, x]"))
