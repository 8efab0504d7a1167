"""Pictures as input: whatever is in a file ends in a picture or in one of clvol's errors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

import clvol
from clvol.base import image_reading
from clvol.base.image_reading import jpeg_is_whole, read_stored
from clvol.errors import SceneError
from clvol.lab.comparison.reference import read_reference
from clvol.picture.image_io import encode_exr, split_channels
from clvol.scene.image import read_image

if TYPE_CHECKING:
    from pathlib import Path

SIZE = 16
FILM = SimpleNamespace(film=SimpleNamespace(window=(0, 0, SIZE, SIZE)))
KINDS = {"exr": "float", "png": "uint8", "jpg": "uint8", "hdr": "float"}


def picture(path: Path, kind: str, **attributes: object) -> bytes:
    """The bytes of a small picture of noise, which is written to `path` too."""
    output = oiio.ImageOutput.create(str(path))
    spec = oiio.ImageSpec(SIZE, SIZE, 3, kind)
    for name, value in attributes.items():
        spec.attribute(name, value)
    noise = np.random.default_rng(0).random((SIZE, SIZE, 3)).astype(np.float32)
    assert output.open(str(path), spec) and output.write_image(noise) and output.close()
    return path.read_bytes()


def use_as_bitmap(path: Path) -> None:
    bsdf = {"type": "diffuse", "reflectance": {"type": "bitmap", "filename": str(path)}}
    load(quad={"type": "rectangle", "bsdf": bsdf})


def use_as_envmap(path: Path) -> None:
    load(sky={"type": "envmap", "filename": str(path)})


def use_as_reference(path: Path) -> None:
    read_reference(path, FILM)


def load(**contents: dict) -> None:
    film = {"type": "hdrfilm", "width": 4, "height": 4}
    clvol.load_dict({"type": "scene", "sensor": {"type": "perspective", "film": film}, **contents})


def test_messages_that_are_not_utf_8_are_shown(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(picture(path, "float").replace(b"chlist", b"ch\xffist", 1))
    with pytest.raises(SceneError, match=r"cannot read image .*ch\ufffdist"):
        read_image(str(path), "here")


@pytest.mark.parametrize("suffix", KINDS)
def test_a_picture_cut_short_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a.{suffix}"
    whole = picture(path, KINDS[suffix])
    read_image(str(path), "here")
    for size in np.linspace(1, len(whole) - (13 if suffix == "png" else 1), 30).astype(int):
        path.write_bytes(whole[:size])  # the last 12 bytes of a .png only say that it ends
        with pytest.raises(SceneError, match="cannot read image"):
            read_image(str(path), "here")


@pytest.mark.parametrize(
    ("data", "whole"),
    [
        (b"\xff\xd8\xff\xda\x00\x02ab\xff\x00\xff\xd0c\xff\xff\xd9", True),  # stuffing, a restart, filling
        (b"\xff\xd8\xff\xda\x00\x02ab\xff\x00\xff\xd0c\xff", False),
        (b"\xff\xd8\xff\xe1\x00\x04\xff\xd9\xff\xda\x00\x02ab", False),  # a thumbnail has an end of its own
        (b"\xff\xd8\xff\xe1\x00\x04\xff\xd9\xff\xda\x00\x02ab\xff\xd9more", True),
        (b"", False),
    ],
)
def test_the_end_of_a_jpeg_is_found(data: bytes, whole: bool) -> None:
    assert jpeg_is_whole(data) is whole


def test_a_progressive_jpeg_is_whole(tmp_path: Path) -> None:
    data = picture(tmp_path / "a.jpg", "uint8", **{"jpeg:progressive": 1})
    assert data.count(b"\xff\xda") > 1 and jpeg_is_whole(data)
    assert not jpeg_is_whole(data[:-1]) and not jpeg_is_whole(data[: data.rindex(b"\xff\xda")])


def test_only_the_channels_that_are_wanted_are_read(tmp_path: Path) -> None:
    planes = split_channels("", np.ones((2, 3, 3))) | {f"more.{n:02}": np.ones((2, 3)) for n in range(40)}
    (tmp_path / "a.exr").write_bytes(encode_exr(planes, {}))
    assert read_stored(str(tmp_path / "a.exr"), channels=4).channels[:3] == ("R", "G", "B")
    assert len(read_stored(str(tmp_path / "a.exr")).channels) == 43


@pytest.mark.parametrize("spp", ["many", "", -3, 0, float("inf")])
def test_metadata_of_a_reference_may_be_anything(tmp_path: Path, spp: object) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(encode_exr(split_channels("", np.ones((SIZE, SIZE, 3))), {"spp": spp, "seeds": "² 4"}))
    found = read_reference(path, FILM)
    assert found.spp is None and found.seeds is None and found.round_spp is None


def test_a_picture_of_grey_needs_room_for_its_colours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = oiio.ImageOutput.create(str(tmp_path / "a.jpg"))
    assert output.open(str(tmp_path / "a.jpg"), oiio.ImageSpec(SIZE, SIZE, 1, "uint8"))
    assert output.write_image(np.ones((SIZE, SIZE, 1), np.float32)) and output.close()
    needed = 4 * SIZE * SIZE * 4
    monkeypatch.setattr(image_reading, "available_memory", lambda: needed)
    assert read_image(str(tmp_path / "a.jpg"), "here").shape == (SIZE, SIZE, 3)
    monkeypatch.setattr(image_reading, "available_memory", lambda: needed - 1)
    with pytest.raises(SceneError, match=r"here: cannot read image .* it takes 4 KiB of memory"):
        read_image(str(tmp_path / "a.jpg"), "here")


def test_a_picture_without_room_is_an_error_with_a_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_given: object, **_options: object) -> None:
        raise MemoryError

    picture(tmp_path / "a.png", "uint8")
    monkeypatch.setattr("clvol.scene.image._linear_rgb", full)
    with pytest.raises(SceneError, match=r"here: cannot read image .* more memory than there is"):
        read_image(str(tmp_path / "a.png"), "here")
