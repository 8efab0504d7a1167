"""Broken and hostile NanoVDB files end in one clear error: no crash, no hang, no memory beyond the limit."""

from __future__ import annotations

import os
import random
import struct
import tracemalloc
import zlib

import blosc
import numpy as np
import pytest
from nvdb_writer import BLOSC, NONE, ZIP, grid_bytes, write_nvdb
from places import CASES
from rich_vdb import rich_grid
from vdb_writer import GridSpec

from clvol.errors import VolumeError
from clvol.volumes import check_coefficients, list_nvdb, read_nvdb
from clvol.volumes.nvdb_bytes import GridBytes
from clvol.volumes.vdb_stream import open_vdb

FILES = CASES / "nvdb"
HEADER, METADATA = 16, 176
ONE_LEAF = {(0, 0, 0): (np.ones((8, 8, 8)), np.ones((8, 8, 8), bool))}


def read_all(path) -> None:
    for number in range(len(list_nvdb(path))):
        grid = read_nvdb(path, number)
        if grid.active_voxels:
            check_coefficients(grid)


def small_file(path, codec: int) -> bytes:
    return write_nvdb(path, [GridSpec(leaves=ONE_LEAF)], codec=codec)


@pytest.fixture(params=["zip", "blosc", "none"])
def healthy(request, tmp_path) -> bytes:
    if request.param != "none":
        return (FILES / f"{request.param}.nvdb").read_bytes()
    return write_nvdb(tmp_path / "none.nvdb", [rich_grid()])


def test_a_file_cut_anywhere_is_an_error(healthy, tmp_path):
    target = tmp_path / "cut.nvdb"
    target.write_bytes(healthy)
    places = random.Random(1)
    for length in sorted((places.randrange(len(healthy)) for _ in range(60)), reverse=True):
        os.truncate(target, length)
        with pytest.raises(VolumeError, match=r"cut\.nvdb"):
            read_all(target)


def lie(path, at: int, layout: str, value, codec: int = NONE) -> None:
    """Overwrite a number of a file with one leaf."""
    data = bytearray(small_file(path, codec))
    struct.pack_into("<" + layout, data, at, value)
    path.write_bytes(data)


NAME = HEADER + METADATA
GRID = NAME + len("density") + 1
ROOT = GRID + 736
UPPER = ROOT + 64 + 32
LOWER = UPPER + 270400
LIES = {
    "version": (8, "I", 31 << 21, "version 31.0 is not supported, 32 is"),
    "no grids": (12, "H", 0, "has no grids"),
    "codec": (14, "H", 3, "codec 3 is not known"),
    "size": (HEADER, "Q", 1 << 60, "bytes of the file hold"),
    "size in the file": (HEADER + 8, "Q", 1 << 60, "are left"),
    "length of the name": (HEADER + 136, "I", 1 << 30, "name takes 1073741824 bytes"),
    "magic of the grid": (GRID, "Q", 0, "does not begin with a grid"),
    "size of the grid": (GRID + 32, "Q", 1 << 50, "its file says"),
    "matrix": (GRID + 384, "d", float("nan"), "not affine and finite"),
    "flat matrix": (GRID + 384, "d", 0.0, "cannot be inverted"),
    "type": (GRID + 636, "I", 99, "of an unknown type, 99"),
    "root before the grid": (GRID + 696, "q", -5000, "is pointed to in a grid of"),
    "root behind the grid": (GRID + 696, "q", 1 << 40, "is pointed to in a grid of"),
    "tiles of the root": (ROOT + 24, "I", 1 << 31, "its root has 2147483648 tiles"),
    "background": (ROOT + 28, "f", float("inf"), "the background is inf"),
    "place of a node": (ROOT + 64, "Q", 1 << 61, "not a multiple of 4096 within"),
    "node behind the grid": (ROOT + 72, "q", 1 << 50, "is pointed to in a grid of"),
    "node before the grid": (ROOT + 72, "q", -300000, "is pointed to in a grid of"),
    "leaf behind the grid": (LOWER + 1088, "q", 1 << 50, "is pointed to in a grid of"),
    "leaf in its parent": (LOWER + 1088, "q", 500, "lies within"),
    "leaf of nothing": (LOWER + 32 + 512, "B", 3, "lies within"),
}


@pytest.mark.parametrize("name", LIES)
def test_a_lie_is_named_and_costs_no_memory(tmp_path, name):
    *change, message = LIES[name]
    lie(tmp_path / "lie.nvdb", *change)
    tracemalloc.start()
    try:
        with pytest.raises(VolumeError, match=message) as caught:
            read_nvdb(tmp_path / "lie.nvdb")
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()
    assert "lie.nvdb" in str(caught.value)


@pytest.mark.parametrize("chunks", [[], [b""], [b"\0" * 40], [bytes(range(200))]])
@pytest.mark.parametrize("codec", [ZIP, BLOSC])
def test_chunks_that_hold_no_grid_are_named(tmp_path, codec, chunks):
    data = small_file(tmp_path / "a.nvdb", codec)
    blob = b"".join(struct.pack("<Q", len(chunk)) + chunk for chunk in chunks)
    blob = blob.ljust(len(data) - GRID, b"\1")
    (tmp_path / "a.nvdb").write_bytes(data[:GRID] + blob)
    with pytest.raises(VolumeError, match=r"a\.nvdb, grid 'density': .*(chunk|unpacks)"):
        read_nvdb(tmp_path / "a.nvdb")


def unpacked(path, codec: int, size: int, offsets, count: int) -> list[bytes]:
    with open_vdb(path) as stream:
        held = GridBytes(stream, codec, 0, stream.end, size)
        return [held.take(offset, count) for offset in offsets]


@pytest.mark.parametrize("shuffle", [blosc.NOSHUFFLE, blosc.SHUFFLE, blosc.BITSHUFFLE])
@pytest.mark.parametrize("size", [1, 4000, 1 << 18, (1 << 20) + 4, 5_000_003])
def test_blocks_of_blosc_are_unpacked_as_blosc_unpacks_the_chunk(tmp_path, size, shuffle):
    rng = np.random.default_rng(size)
    raw = np.repeat(rng.integers(0, 255, size // 3 + 1, np.uint8), 3)[:size].tobytes()
    chunks = [
        blosc.compress(part, 4, 9, shuffle, "lz4") for part in (raw[: size // 2], raw[size // 2 :]) if part
    ]
    path = tmp_path / "a.bin"
    path.write_bytes(b"".join(struct.pack("<Q", len(chunk)) + chunk for chunk in chunks))
    offsets = [0, size // 3, size // 2, max(0, size - 100), 0]  # the last is a step back
    count = min(100, size - size // 2)
    assert unpacked(path, BLOSC, size, offsets, count) == [raw[at : at + count] for at in offsets]


def test_a_bomb_is_not_unpacked_beyond_what_is_asked_for(tmp_path):
    size = 1 << 26
    squeezer = zlib.compressobj(9)
    bomb = b"".join(squeezer.compress(bytes(1 << 20)) for _ in range(size >> 20)) + squeezer.flush()
    (tmp_path / "a.bin").write_bytes(struct.pack("<Q", len(bomb)) + bomb)
    tracemalloc.start()
    try:
        assert unpacked(tmp_path / "a.bin", ZIP, size, [0, size // 2], 10) == [bytes(10)] * 2
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("codec", [NONE, ZIP, BLOSC])
def test_memory_is_that_of_the_samples_whatever_the_codec(tmp_path, codec):
    values = np.random.default_rng(1).random((8, 8, 8)).astype("f4")
    places = [(8 * x, 8 * y, 8 * z) for x in range(16) for y in range(16) for z in range(32)]
    spec = GridSpec(leaves=dict.fromkeys(places, (values, np.ones((8, 8, 8), bool))))
    write_nvdb(tmp_path / "a.nvdb", [spec], codec=codec)
    tracemalloc.start()
    try:
        read = read_nvdb(tmp_path / "a.nvdb")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(read.leaf_values) == len(places)
    assert peak < 1.25 * read.leaf_values.nbytes + (8 << 20)


def test_more_than_the_limit_is_refused_before_it_is_allocated(tmp_path):
    spec = rich_grid()
    write_nvdb(tmp_path / "a.nvdb", [spec])
    needed = 2124 * len(spec.leaves) + 42 * len(spec.tiles)
    assert len(read_nvdb(tmp_path / "a.nvdb", max_bytes=needed).leaf_values) == len(spec.leaves)
    with pytest.raises(VolumeError, match=f"more than the limit of {needed - 1} bytes"):
        read_nvdb(tmp_path / "a.nvdb", max_bytes=needed - 1)


def test_values_that_are_not_finite_are_counted(tmp_path):
    values = np.ones((8, 8, 8))
    values[0, 0, :3] = np.nan, np.inf, -1
    write_nvdb(tmp_path / "a.nvdb", [GridSpec(leaves={(0, 0, 0): (values, values > 0)})])
    with pytest.raises(VolumeError, match="2 NaN or infinite and 1 negative"):
        check_coefficients(read_nvdb(tmp_path / "a.nvdb"))


def test_a_bare_grid_that_says_too_much_is_an_error(tmp_path):
    data = bytearray(grid_bytes(GridSpec(leaves=ONE_LEAF), "Float", 32 << 21, b"NanoVDB1"))
    struct.pack_into("<Q", data, 32, len(data) + 1)
    (tmp_path / "a.nvdb").write_bytes(data)
    with pytest.raises(VolumeError, match="says that it takes"):
        list_nvdb(tmp_path / "a.nvdb")
