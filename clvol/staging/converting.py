"""A scene of another format, or of another version of Mitsuba's, as a Mitsuba 3 XML file.

It is what was read, in Mitsuba's vocabulary, with what clvol adds to it.  Pictures, samples and meshes that
XML has no place for lie beside it, as FILE_mesh_1.ply, FILE_volume_1.vol and FILE_picture_1.exr.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.output_files import check_file, check_spares, output_suffix, write_file
from clvol.errors import OptionError, either, option
from clvol.picture.image_io import encode_exr, split_channels
from clvol.scene.loader import load_nodes
from clvol.scene.modern import modernise
from clvol.scene.node_xml import nodes_xml
from clvol.scene.pbrt.translation import is_pbrt
from clvol.scene.ply_writing import encode_ply
from clvol.scene.transforms import scale, translate
from clvol.scene.xml import is_old
from clvol.volumes.filled import filled
from clvol.volumes.vol import write_vol

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from clvol.base.output_files import StrPath
    from clvol.scene.records import Mesh
    from clvol.volumes.grid import SparseGrid

_UNIT_BOX = np.array([[0.0, 0, 0], [1, 1, 1]])


def convert_scene(
    path: StrPath, output: StrPath, definitions: Mapping[str, str], overwrite: bool = False
) -> list[str]:
    """Write the scene of a .pbrt file, or of an XML file of Mitsuba before version 2, as `output`, .xml.

    Parameters
    ----------
    definitions : values of its `<default>`s, which the new scene has none of.
    overwrite : files that are there already are replaced.

    Returns
    -------
    list of str
        The names of what was written, the scene first.

    Raises
    ------
    SceneError, VolumeError
        As `load_file`: a scene that cannot be rendered is not written.
    OptionError
        A scene of version 2 or 3, and files that cannot be written or are there already.
    """
    output_suffix(output, (".xml",))
    check_file(output)
    if not is_pbrt(path) and not is_old(Path(path)):
        hint = either("load_file takes it", "`clvol render` takes it as it is, `clvol info` tells of it")
        raise OptionError("is a scene already, not a volume", str(path), hint)
    scene, root = load_nodes(path, definitions)
    modernise(root)
    files = _Files(Path(output))
    comment = "\n     ".join([f"Converted by clvol from {Path(path).name}.", *map(str, scene.approximated)])
    xml = nodes_xml(root, files, comment)
    _check(files.writing, scene.files, overwrite)
    for name, write in files.writing.items():
        write(name)
    write_file(output, xml.encode())
    return list(map(str, files.writing))


def _check(written: Iterable[Path], read: Iterable[str], overwrite: bool) -> None:
    for file in written:
        check_spares(file, read)
        if not overwrite and os.path.lexists(file):
            hint = f"give the scene another name, or {option('overwrite', True)}"
            raise OptionError("is there already", str(file), hint)


class _Files:
    """What lies beside the scene `target`, each thing once.

    writing : what writes a file, by its name; the first is `target`, which does not write itself.
    """

    def __init__(self, target: Path) -> None:
        self.target = target
        self.writing: dict[Path, Callable[[Path], None]] = {target: lambda _: None}
        self._names: dict[int, str] = {}
        self._kept: list[object] = []  # alive, since their id() is a key

    def named(self, path: Path, address: str | None) -> str:
        """A file that is there, as seen from the scene's folder."""
        name = str(path) if path.is_absolute() else os.path.relpath(path, self.target.parent)
        return name if address is None else f"{name}:{address}"

    def picture(self, pixels: np.ndarray) -> str:
        """Linear colours, as EXR."""
        channels = split_channels("", np.asarray(pixels, np.float32))
        return self._beside(
            pixels, "picture", ".exr", lambda path: write_file(path, encode_exr(channels, {}))
        )

    def volume(self, samples: np.ndarray) -> str:
        """Samples, as Mitsuba's VOL."""
        return self._beside(samples, "volume", ".vol", lambda path: write_vol(path, samples, _UNIT_BOX))

    def sparse(self, grid: SparseGrid) -> tuple[str, np.ndarray]:
        """Samples of a sparse grid, as VOL, and where their cube lies."""
        counts = np.ptp(grid.active_box, axis=0).astype(np.float64) + 3
        lower = grid.active_box[0] - 1.5

        def write(path: Path) -> None:
            write_vol(path, filled(grid)[0], _UNIT_BOX)

        moved: np.ndarray = grid.index_to_world @ translate(lower) @ scale(counts)
        return self._beside(grid, "volume", ".vol", write), moved

    def mesh(self, mesh: Mesh) -> str:
        """Triangles, as PLY."""
        return self._beside(mesh, "mesh", ".ply", lambda path: write_file(path, encode_ply(mesh)))

    def _beside(self, thing: object, kind: str, suffix: str, write: Callable[[Path], None]) -> str:
        if id(thing) not in self._names:
            number = 1 + sum(file.suffix == suffix for file in self.writing)
            file = self.target.with_name(f"{self.target.stem}_{kind}_{number}{suffix}")
            self.writing[file] = write
            self._names[id(thing)] = file.name
            self._kept.append(thing)
        return self._names[id(thing)]
