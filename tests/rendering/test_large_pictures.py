"""Pictures of few bytes and many pixels take little more than their texels, and have a stated limit."""

import struct
import tracemalloc
import zlib

import numpy as np
import pytest

import clvol
from clvol.base import rows
from clvol.base.image_reading import MAX_PIXELS
from clvol.scene.materials import Bitmap
from clvol.tables.colours import LUMINANCE, luminance, mean_luminance
from clvol.tables.environment import envmap_distribution
from clvol.tables.lights import envmap_arrays
from clvol.tables.textures import TextureTable


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def grey_png(width, height, colour_type=0, depth=1):
    """A black PNG of one bit a pixel, or of 8-bit RGB for colour type 2."""
    row = bytes(1 + (width * depth * (3 if colour_type == 2 else 1) + 7) // 8)
    body = zlib.compressobj(9)
    data = b"".join(body.compress(row) for _ in range(height)) + body.flush()
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def envmap_scene(**keywords):
    return {
        "type": "scene",
        "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
        "sky": {"type": "envmap", **keywords},
    }


def whole_distribution(radiance):
    """The distribution as one sum over the whole picture, in double."""
    height = len(radiance)
    y = luminance(radiance.astype(np.float64))
    cells = (y + np.roll(y, -1, axis=1))[:-1] + (y + np.roll(y, -1, axis=1))[1:]
    cells *= np.sin((np.arange(height - 1) + 0.5) * np.pi / (height - 1))[:, None]
    cells = cells if cells.any() else np.ones_like(cells)
    marginal = np.concatenate([[0.0], np.cumsum(cells.sum(axis=1)) / cells.sum()])
    return marginal, np.cumsum(cells, axis=1) / np.maximum(cells.sum(axis=1), 1e-300)[:, None]


@pytest.mark.parametrize("pixels", [1, 100, 1 << 18])
@pytest.mark.parametrize("dark", ["nothing", "rows", "all"])
def test_sampling_tables_by_bands_are_those_of_the_whole(monkeypatch, pixels, dark):
    radiance = np.random.default_rng(1).random((37, 23, 3)).astype(np.float32) ** 4
    radiance[{"nothing": slice(0), "rows": slice(8, 14), "all": slice(None)}[dark]] = 0
    monkeypatch.setattr(rows, "CHUNK_PIXELS", pixels)
    marginal, conditional = envmap_distribution(radiance)
    assert marginal.dtype == conditional.dtype == np.float32
    assert (conditional[:, 0] == 0).all() and (conditional[:, -1] == 1).all()
    exact = whole_distribution(radiance)
    np.testing.assert_allclose(marginal, exact[0], rtol=2e-7, atol=1e-12)
    np.testing.assert_allclose(conditional[:, 1:-1], exact[1][:, :-1], rtol=2e-7, atol=1e-12)
    assert mean_luminance(radiance) == pytest.approx(luminance(radiance).mean(), rel=1e-12)


@pytest.mark.parametrize(("colour_type", "depth"), [(0, 1), (2, 8)])
def test_an_environment_takes_its_texels_and_its_tables(tmp_path, colour_type, depth):
    """12 bytes of texels a pixel and 4 of tables, and what is decoded at once of a grey one: 4."""
    width, height = 2048, 1024
    path = tmp_path / "black.png"
    path.write_bytes(grey_png(width, height, colour_type, depth))
    assert len(path.read_bytes()) < 20_000
    tracemalloc.start()
    scene = clvol.load_dict(envmap_scene(filename=str(path), scale=2.0))
    loaded = tracemalloc.get_traced_memory()[1]
    arrays = envmap_arrays(scene.emitters[0])
    assert scene.emitters[0].radiance.shape == (height, width, 3)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    bands = 20 << 20
    assert loaded < 16 * width * height + bands
    assert peak < 17 * width * height + bands
    assert arrays["env_texels"] is scene.emitters[0].radiance


def test_a_texture_as_a_number_is_worked_out_by_bands():
    pixels = np.random.default_rng(2).random((512, 2048, 3)).astype(np.float32)
    table = TextureTable()
    tracemalloc.start()
    table.add(Bitmap(pixels, np.eye(3), "bilinear", "repeat", ""), as_number=True)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (table.texels[0] == (pixels.reshape(-1, 3) @ LUMINANCE).astype(np.float32)[:, None]).all()
    assert peak < 12 * pixels.size // 3 + (10 << 20)


def test_a_picture_given_as_an_array_is_not_changed():
    given = np.random.default_rng(3).random((8, 16, 3)).astype(np.float32)
    given[0, 0, 0] = -1e-9
    kept = given.copy()
    radiance = clvol.load_dict(envmap_scene(bitmap=given, scale=3.0)).emitters[0].radiance
    assert (given == kept).all()
    assert (radiance == np.maximum(kept * np.float32(3), 0)).all()
    given[:] = 7
    assert radiance.max() < 4, "the scene has its own"


def test_pictures_beyond_the_limit_are_refused_before_they_are_decoded(tmp_path):
    width, height = 16384, MAX_PIXELS // 16384 + 1
    path = tmp_path / "bomb.png"
    data = bytearray(grey_png(width, 1))
    data[16:24] = struct.pack(">II", width, height)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    path.write_bytes(data)
    with pytest.raises(clvol.SceneError, match=rf"{width} x {height}, .* limit of {MAX_PIXELS} pixels"):
        clvol.load_dict(envmap_scene(filename=str(path)))
