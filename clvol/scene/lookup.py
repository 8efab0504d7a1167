"""Where a file that a scene names is found."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from clvol.base.files import note_file, other_kind
from clvol.errors import SceneError
from clvol.scene.faults import MissingFileError

if TYPE_CHECKING:
    from collections.abc import Sequence


def find(name: str, folders: Sequence[Path], where: str, folder_too: bool = False) -> Path:
    """The first of `folders` that holds file `name`, joined with it; an absolute `name` as it is.

    `folder_too`: it may be a folder.

    Raises
    ------
    SceneError
        At `where`: no such file (`MissingFileError`), or something that is no regular file, such as a pipe.
    """
    for folder in folders:
        path = folder / name
        # false, unlike Path.is_file, for a name too long for the system
        if os.path.isfile(path):
            note_file(path)
            return path
        if folder_too and os.path.isdir(path):
            return path
        if kind := other_kind(path):
            raise SceneError(f"'{path}' is {kind}, not a file", where)
    looked = ", ".join(str(folder.absolute()) for folder in folders)
    hint = "check the absolute path" if Path(name).is_absolute() else f"looked in {looked}"
    raise MissingFileError(f"file '{name}' does not exist", where, hint)
