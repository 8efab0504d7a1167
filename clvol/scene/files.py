"""Where the files that a scene names are found."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from clvol.base.files import note_file, other_kind
from clvol.errors import SceneError
from clvol.scene.faults import MissingFileError
from clvol.volumes.read import split_address

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.scene.reader import Reader


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


def find_parameter(reader: Reader, name: str) -> Path:
    """The file that string parameter `name`, which must be given, names."""
    return find(reader.string(name, ""), reader.node.folders, reader.node.place(name))


def find_volume(reader: Reader, name: str) -> tuple[Path, str | None]:
    """The file or folder of the volume that string parameter `name`, which must be given, names.

    And the array in it that it names, as "scan.h5:/density" does, else None.
    """
    file, grid = split_address(reader.string(name, ""))
    return find(file, reader.node.folders, reader.node.place(name), folder_too=True), grid
