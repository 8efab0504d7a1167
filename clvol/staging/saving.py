"""A staged scene as a file of its own: XML, and beside it what XML cannot hold."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.base.image_reading import UnreadableError, read_stored
from clvol.base.output_files import check_file, check_spares, output_suffix, write_file
from clvol.errors import OptionError
from clvol.picture.image_io import encode_exr, split_channels
from clvol.scene.xml_writing import scene_xml

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.base.output_files import StrPath
    from clvol.staging.stage import Staged

_ELSEWHERE = "give the scene another name, or --overwrite"


def check_scene(path: StrPath, volume: StrPath) -> None:
    """Raise OptionError now for a scene's file that could not be written or would replace the volume."""
    output_suffix(path, (".xml",))
    check_file(path)
    if os.path.realpath(path) == os.path.realpath(volume):
        raise OptionError("would replace the volume", str(path))


def save_scene(staged: Staged, path: StrPath, overwrite: bool = False) -> list[str]:
    """Write the scene as `path`, .xml, and its environment beside it; the names of all files.

    Paths of volumes become relative to the scene's folder, where they were not absolute.

    Parameters
    ----------
    overwrite : a scene or an environment that is there already, and is another one, is replaced.

    OptionError where a file cannot be written, or would replace what the scene is read from.
    """
    target = Path(path)
    beside: dict[Path, bytes] = {}

    def attach(name: str, array: np.ndarray) -> str:
        file = target.with_name(f"{target.stem}_environment.exr")
        beside[file] = encode_exr(split_channels("", array), {})
        if not overwrite and os.path.lexists(file) and not _holds(file, array):
            what = "is there already, and is another light than this scene's"
            raise OptionError(what, str(file), _ELSEWHERE)
        return file.name

    comment = "\n     ".join([f"The scene that clvol makes of {staged.source.name}.", *staged.lines])
    xml = scene_xml(_moved(staged.description, target.parent), attach, comment).encode()
    if not overwrite and os.path.lexists(target) and not (target.is_file() and target.read_bytes() == xml):
        raise OptionError("is there already, and is another scene, or was edited", str(target), _ELSEWHERE)
    for file in (target, *beside):
        check_spares(file, staged.source.files)
    for file, data in (beside | {target: xml}).items():
        write_file(file, data)
    return [str(target), *map(str, beside)]


def _holds(file: Path, array: np.ndarray) -> bool:
    """Whether a file is just that picture: the one of the scene's earlier version, which stays the same."""
    try:
        return file.is_file() and np.array_equal(read_stored(str(file)).pixels, array)
    except (OSError, UnreadableError):
        return False


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
