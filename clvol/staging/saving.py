"""A staged scene as a file of its own: XML, and beside it what XML cannot hold."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clvol.base.output_files import check_file, output_suffix, write_file
from clvol.errors import OptionError
from clvol.picture.image_io import encode_exr, split_channels
from clvol.scene.xml_writing import scene_xml

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from clvol.base.output_files import StrPath
    from clvol.staging.stage import Staged


def check_scene(path: StrPath, volume: StrPath) -> None:
    """Raise OptionError now for a scene's file that could not be written, or would replace the volume."""
    output_suffix(path, (".xml",))
    check_file(path)
    if os.path.realpath(path) == os.path.realpath(volume):
        raise OptionError("would replace the volume", str(path))


def save_scene(staged: Staged, path: StrPath) -> list[str]:
    """Write the scene as `path`, .xml, and environments beside it; the names of all files.

    Paths of volumes become relative to the scene's folder, where they were not absolute.  OptionError where a
    file cannot be written.
    """
    target = Path(path)
    written: list[str] = []

    def attach(name: str, array: np.ndarray) -> str:
        file = target.with_name(f"{target.stem}_environment.exr")
        write_file(file, encode_exr(split_channels("", array), {}))
        written.append(str(file))
        return file.name

    comment = "\n     ".join([f"The scene that clvol makes of {staged.source.name}.", *staged.lines])
    xml = scene_xml(_moved(staged.description, target.parent), attach, comment)
    write_file(target, xml.encode())
    return [str(target), *written]


def _moved(described: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The description with its files' names as seen from a folder."""
    return {
        key: _moved(value, folder)
        if isinstance(value, dict)
        else os.path.relpath(value, folder)
        if key == "filename" and not os.path.isabs(value)
        else value
        for key, value in described.items()
    }
