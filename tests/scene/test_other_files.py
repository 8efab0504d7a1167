"""Files that are neither scenes nor volumes: what they are is said, and what to do with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import clvol
from clvol.picture.image_io import encode_exr, split_channels

if TYPE_CHECKING:
    from pathlib import Path

EXR = encode_exr(split_channels("", np.ones((2, 2, 3), np.float32)), {})


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.obj", b"v 0 0 0\n", "is an OBJ mesh, .*scenes name meshes in a shape"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "is a PLY mesh"),
        ("a.exr", EXR, "is an OpenEXR picture, .*scenes name pictures in an envmap or a bitmap"),
        ("a.png", b"\x89PNG\r\n\x1a\n", "is a PNG picture"),
        ("renamed.xml", b"\x89PNG\r\n\x1a\n", "is a PNG picture"),
        ("a.md", b"# Smoke\n", "is a text, .*scenes are Mitsuba's .xml"),
        ("a.blend", b"BLENDER-v300", "is a Blender file, .*export its volumes as .vdb"),
        ("renamed.xml", b" BDV" + bytes(60), "is an OpenVDB volume, not a scene; "),
        ("a.xyz", b"1 2 3\n", "is neither a scene nor a volume; scenes are .*volumes .vdb"),
        ("a.xml", b"", "is empty"),
        ("a.xml", b"v 0 0 0", "broken XML"),
    ],
)
def test_what_is_no_scene_says_what_it_is(name: str, data: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(clvol.SceneError, match=says):
        clvol.load_file(path)
    if path.suffix != ".xml":
        what = "cannot be read" if "neither" in says else says.split(",")[0]
        with pytest.raises(clvol.VolumeError, match=what):
            clvol.load_volume(path)


def test_scenes_may_have_other_names_and_byte_orders(tmp_path: Path) -> None:
    text = '<scene version="3.0.0"></scene>'
    for name, data in {"a.txt": b"\xef\xbb\xbf\n " + text.encode(), "b.scene": text.encode("utf-16")}.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(clvol.SceneError, match="the scene has no sensor"):
            clvol.load_file(tmp_path / name)


def test_a_picture_is_told_from_a_stack(tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile", reason="the extra 'science' is not installed")
    path = tmp_path / "a.tif"
    for shape in ((4, 5, 3), (4, 5)):
        tifffile.imwrite(path, np.ones(shape, np.uint8))
        with pytest.raises(clvol.VolumeError, match=r"is one picture, of 5 x 4 pixels.*a page each"):
            clvol.load_volume(path)
    tifffile.imwrite(path, np.ones((2, 4, 5, 3), np.uint8), photometric="rgb")
    assert clvol.load_volume(path).values.shape == (2, 4, 5, 3)
