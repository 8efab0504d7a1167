"""The files that parameters of plugins name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clvol.scene.lookup import find
from clvol.volumes.read import split_address

if TYPE_CHECKING:
    from pathlib import Path

    from clvol.scene.reader import Reader


def find_parameter(reader: Reader, name: str) -> Path:
    """The file that string parameter `name`, which must be given, names."""
    return find(reader.string(name, ""), reader.node.folders, reader.node.place(name))


def find_volume(reader: Reader, name: str) -> tuple[Path, str | None]:
    """The file or folder of the volume that string parameter `name`, which must be given, names.

    And the array in it that it names, as "scan.h5:/density" does, else None.
    """
    file, grid = split_address(reader.string(name, ""))
    return find(file, reader.node.folders, reader.node.place(name), folder_too=True), grid
