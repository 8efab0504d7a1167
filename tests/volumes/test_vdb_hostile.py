"""Broken and hostile OpenVDB files end in one clear error: no crash, no hang, no memory beyond the limit."""

from __future__ import annotations

import io
import os
import random
import re
import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import blosc
import numpy as np
import pytest
from places import SCENES
from vdb_writer import ACTIVE_MASK, BLOSC, MAGIC, ZIP, GridSpec, write_vdb

from clvol.errors import VolumeError
from clvol.volumes import check_coefficients, list_vdb, read_vdb
from clvol.volumes.vdb import find_grid
from clvol.volumes.vdb_stream import VdbStream, decompress_blosc, decompress_zip, open_vdb

FIRE = SCENES / "fire.vdb"
DATA = os.environ.get("CLVOL_DATA")
needs_data = pytest.mark.skipif(not DATA, reason="CLVOL_DATA does not name the folder of test data")
REAL_FILES = [
    FIRE,
    pytest.param(Path(DATA or "") / "fire_small.vdb", marks=needs_data),
    pytest.param(Path(DATA or "") / "box_fog.vdb", marks=needs_data),
]


def bytes_needed(path: Path) -> tuple[bytearray, int]:
    """The file up to the end of the grid "density", and where its directory says where that is."""
    with open_vdb(path) as stream:
        _, entry = find_grid(stream, "density")
    data = bytearray(path.read_bytes()[: entry.end_pos])
    place = entry.grid_pos - 8
    assert struct.unpack_from("<q", data, place) == (entry.end_pos,)
    return data, place


@pytest.mark.parametrize("path", REAL_FILES, ids=lambda p: p.name)
def test_a_file_cut_anywhere_is_an_error(path, tmp_path):
    data, _ = bytes_needed(path)
    target = tmp_path / "cut.vdb"
    target.write_bytes(data)
    read_vdb(target)
    os.truncate(target, len(data) - 1)
    with pytest.raises(VolumeError, match=f"its last byte is {len(data)}, the file ends at {len(data) - 1}"):
        read_vdb(target)
    places = random.Random(1)
    for length in sorted((places.randrange(len(data)) for _ in range(200)), reverse=True):
        os.truncate(target, length)
        with pytest.raises(VolumeError, match=r"cut\.vdb"):
            read_vdb(target)


@pytest.mark.parametrize("path", REAL_FILES, ids=lambda p: p.name)
def test_a_cut_tree_is_an_error_even_where_the_directory_hides_the_cut(path, tmp_path):
    data, directory = bytes_needed(path)
    target = tmp_path / "cut.vdb"
    target.write_bytes(data)
    places = random.Random(1)
    for length in sorted((places.randrange(directory + 8, len(data)) for _ in range(100)), reverse=True):
        with target.open("r+b") as file:
            file.seek(directory)
            file.write(struct.pack("<q", length))
        os.truncate(target, length)
        with pytest.raises(VolumeError, match=r"cut\.vdb"):
            read_vdb(target)


@pytest.mark.parametrize("path", REAL_FILES, ids=lambda p: p.name)
def test_a_flipped_byte_is_an_error_or_leaves_a_valid_grid(path, tmp_path):
    data, _ = bytes_needed(path)
    target = tmp_path / "flipped.vdb"
    target.write_bytes(data)
    places, errors = random.Random(2), 0
    with target.open("r+b") as file:
        for _ in range(200):
            place = places.randrange(len(data))
            file.seek(place)
            file.write(bytes([data[place] ^ places.randrange(1, 256)]))
            file.flush()
            try:
                grid = read_vdb(target)
                check_coefficients(grid)
            except VolumeError as error:
                errors += 1
                assert "flipped.vdb" in str(error)
                assert "\n" not in str(error)
            else:
                for values in (grid.leaf_values, grid.tile_values, grid.index_to_world, grid.background):
                    assert np.isfinite(values).all()
            file.seek(place)
            file.write(data[place : place + 1])
    assert errors >= 5


FUZZ_BLOSC = """
import random, blosc, numpy as np
from clvol.volumes.vdb_stream import decompress_blosc
rng, random = np.random.default_rng(3), random.Random(3)
chunks = []
for count, kind in ((512, "f4"), (300, "f2"), (32768, "f4")):
    raw = np.round(rng.random(count), 2).astype(kind).tobytes()
    for name in ("lz4", "blosclz", "zlib", "zstd"):
        for shuffle in (blosc.NOSHUFFLE, blosc.SHUFFLE, blosc.BITSHUFFLE):
            chunks.append((blosc.compress(raw, int(kind[1]), 9, shuffle, name), len(raw)))
refused = 0
for trial in range(20_000):
    chunk, size = chunks[trial % len(chunks)]
    broken = bytearray(chunk)
    for _ in range(random.choice((1, 1, 2, 8))):
        place = random.randrange(40) if random.random() < 0.5 else random.randrange(len(broken))
        broken[min(place, len(broken) - 1)] = random.choice((0, 1, 127, 128, 255, random.randrange(256)))
    try:
        assert len(decompress_blosc(bytes(broken), size)) == size
    except ValueError:
        refused += 1
print(refused)
"""


def test_20000_damaged_blosc_chunks_do_not_crash_the_c_library():
    run = subprocess.run(
        [sys.executable, "-c", FUZZ_BLOSC],
        cwd=SCENES.parent,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 5_000


@pytest.mark.parametrize(
    ("field", "offset", "layout", "value"),
    [
        ("format", 0, "B", 3),
        ("type size", 3, "B", 0),
        ("bytes, larger", 4, "I", 1 << 31),
        ("bytes, smaller", 4, "I", 2047),
        ("block size of nothing", 8, "I", 0),
        ("block size", 8, "I", 4096),
        ("compressed bytes, larger", 12, "I", 1 << 30),
        ("compressed bytes, smaller", 12, "I", 17),
    ],
)
def test_a_lie_in_a_blosc_header_is_found_before_the_c_library_sees_it(
    field, offset, layout, value, monkeypatch
):
    chunk = bytearray(blosc.compress(np.arange(512, dtype="f4").tobytes(), 4, cname="lz4"))
    assert len(decompress_blosc(bytes(chunk), 2048)) == 2048
    struct.pack_into("<" + layout, chunk, offset, value)
    monkeypatch.setattr(blosc, "decompress", lambda _: pytest.fail(f"blosc saw a wrong {field}"))
    with pytest.raises(ValueError, match="blosc"):
        decompress_blosc(bytes(chunk), 2048)


def peak_bytes(action) -> int:
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_zip_bomb_is_not_inflated():
    bomb = zlib.compress(bytes(64 << 20))

    def explode():
        with pytest.raises(ValueError, match="not 2048 bytes"):
            decompress_zip(bomb, 2048)

    assert peak_bytes(explode) < 1 << 20


@pytest.mark.parametrize("raw", [bytes(2047), bytes(2049)])
def test_a_zip_block_of_another_size_is_refused(raw):
    with pytest.raises(ValueError, match="not 2048 bytes"):
        decompress_zip(zlib.compress(raw), 2048)


def test_a_zip_block_with_a_wrong_checksum_or_none_is_refused():
    packed = bytearray(zlib.compress(bytes(2048)))
    with pytest.raises(ValueError, match="not 2048 bytes"):
        decompress_zip(bytes(packed[:-4]), 2048)
    packed[-1] ^= 1
    with pytest.raises(ValueError, match="zlib"):
        decompress_zip(bytes(packed), 2048)


@pytest.mark.parametrize("codec", [ZIP, BLOSC])
def test_a_block_larger_than_any_compressor_makes_is_not_even_copied(codec):
    stream = VdbStream(io.BytesIO(struct.pack("<q", 16 << 20) + bytes(16 << 20)), "a.vdb")

    def read():
        with pytest.raises(VolumeError, match="takes 16777216 bytes compressed"):
            stream.block(2048, codec)

    assert peak_bytes(read) < 1 << 20


# Lies in a small file: each field that a reader could trust too much.


def small_grid(**options) -> GridSpec:
    values = np.arange(512.0).reshape(8, 8, 8)
    return GridSpec(
        leaves={(-8, 0, 0): (values, values > 100), (0, 0, 0): (values, values > 7)},
        tiles=[((0, 128, 128), 128, 3.5, True), ((0, -4096, 0), 4096, 77.25, True)],
        background=0.5,
        **options,
    )


def patched(tmp_path, find: bytes, new: bytes, skip: int = 0, **options) -> Path:
    """A file of `small_grid` with `new` written over the bytes `skip` after the only `find`."""
    path = tmp_path / "lie.vdb"
    data = bytearray(write_vdb(path, [small_grid(**options)]))
    read_vdb(path)
    assert data.count(find) == 1
    place = data.index(find) + skip
    data[place : place + len(new)] = new
    path.write_bytes(data)
    return path


HUGE = b"\xff\xff\xff\x7f"
ROOT = struct.pack("<ifII", 1, 0.5, 1, 2)
FIRST_CHILD = struct.pack("<3i", -4096, 0, 0)
FAR = struct.pack("<i", 1 << 29)
OFF_LATTICE = struct.pack("<i", 4100)
STRAY = struct.pack("<3i", (1 << 24) - 4096, -(1 << 24), 0)
NAN, INFINITE = struct.pack("<f", np.nan), struct.pack("<f", np.inf)
GRID_COUNT = b"clvol tests" + struct.pack("<i", 1)
FLAGS_AND_METADATA = struct.pack("<Ii", ACTIVE_MASK, 0) + struct.pack("<I", 15) + b"Uniform"
FIRST_SCALE = b"ScaleMap" + struct.pack("<d", 1)
LIES = {
    "magic": (struct.pack("<q", MAGIC), b"\0", 0, "magic number"),
    "version": (struct.pack("<II", 224, 10), struct.pack("<I", 9999), 0, "version 9999"),
    "old version": (struct.pack("<II", 224, 10), struct.pack("<I", 220), 0, "version 220"),
    "grid count": (GRID_COUNT, HUGE, 11, "grids are announced"),
    "negative grid count": (GRID_COUNT, b"\xff" * 4, 11, "grids are announced"),
    "string length": (struct.pack("<I", 7) + b"density", HUGE, 0, "bytes are needed"),
    "type length": (struct.pack("<I", 16) + b"Tree_", b"\xff" * 4, 0, "bytes are needed"),
    "compression flags": (FLAGS_AND_METADATA, b"\x0a", 0, "compression flags"),
    "metadata count": (FLAGS_AND_METADATA, HUGE, 4, "metadata are announced"),
    "NaN scale": (FIRST_SCALE, struct.pack("<d", np.nan), 8, "not affine and finite"),
    "zero scale": (FIRST_SCALE, struct.pack("<d", 0), 8, "cannot be inverted"),
    "buffers": (ROOT, HUGE, 0, "buffers"),
    "NaN background": (ROOT, NAN, 4, "background is nan"),
    "infinite background": (ROOT, INFINITE, 4, "background is inf"),
    "root tile count": (ROOT, HUGE, 8, "bytes are needed"),
    "root child count": (ROOT, b"\xff" * 4, 12, "bytes are needed"),
    "far origin": (FIRST_CHILD, FAR, 0, "multiple of 4096"),
    "origin off the lattice": (FIRST_CHILD, OFF_LATTICE, 0, "multiple of 4096"),
    "same origin twice": (FIRST_CHILD, struct.pack("<i", 0), 0, "two nodes lie at"),
    "absurd box": (FIRST_CHILD, STRAY, 0, "span"),
    "far root tile": (struct.pack("<f?", 77.25, True), FAR, -12, "multiple of 4096"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_named_and_costs_no_memory(tmp_path, lie):
    find, new, skip, message = LIES[lie]
    path = patched(tmp_path, find, new, skip, compression=ACTIVE_MASK)

    def read():
        with pytest.raises(VolumeError, match=message) as caught:
            read_vdb(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)

    assert peak_bytes(read) < 4 << 20


def test_root_tiles_that_no_brick_map_can_index_are_refused(tmp_path):
    path = tmp_path / "tiles.vdb"
    far = [((4096 * i, 0, 0), 4096, 0, False) for i in range(1000)]
    write_vdb(path, [GridSpec(tiles=[*far, ((0, 4096, 0), 4096, 1, True)])])
    assert read_vdb(path).tile_origins.tolist() == [[0, 4096, 0]]
    write_vdb(path, [GridSpec(tiles=[(*tile[:3], True) for tile in far])])
    with pytest.raises(
        VolumeError, match=r"1000 root tiles of 4096³ samples have 1579014000 bricks at their sides"
    ):
        read_vdb(path)


def test_an_unknown_code_of_inactive_values_is_named(tmp_path):
    path = tmp_path / "code.vdb"
    data = bytearray(write_vdb(path, [small_grid()]))
    assert data[-2049] == 6
    data[-2049] = 7
    path.write_bytes(data)
    with pytest.raises(VolumeError, match="code 7"):
        read_vdb(path)


@pytest.mark.parametrize("codec", [ZIP, BLOSC])
@pytest.mark.parametrize("size", [1 << 62, 1 << 40, -(1 << 62), -1, 0, -(1 << 63), 5000])
def test_a_lie_about_a_blocks_size_is_an_error(tmp_path, codec, size):
    path = tmp_path / "size.vdb"
    noise = np.random.default_rng(4).integers(0, 1 << 31, (8, 8, 8)).astype("i4").view("f4")
    leaf = (np.nan_to_num(noise), np.ones((8, 8, 8), bool))
    data = bytearray(write_vdb(path, [GridSpec(leaves={(0, 0, 0): leaf}, compression=codec)]))
    read_vdb(path)
    place = data.rindex(b"\xff" * 64 + b"\x06") + 65
    struct.pack_into("<q", data, place, size)
    path.write_bytes(data)
    with pytest.raises(VolumeError, match="bytes"):
        read_vdb(path)


def test_a_damaged_block_of_each_codec_is_an_error(tmp_path):
    values = np.zeros((8, 8, 8))
    for codec in (ZIP, BLOSC):
        path = tmp_path / "block.vdb"
        leaf = (values, np.ones((8, 8, 8), bool))
        data = bytearray(write_vdb(path, [GridSpec(leaves={(0, 0, 0): leaf}, compression=codec)]))
        data[-8:] = b"\xff" * 8
        path.write_bytes(data)
        with pytest.raises(VolumeError, match="damaged"):
            read_vdb(path)


def test_a_tree_that_ends_early_is_an_error(tmp_path):
    path = tmp_path / "early.vdb"
    data = bytearray(write_vdb(path, [GridSpec()]))
    entry = data.index(b"Tree_float_5_4_3") + 20
    end = struct.unpack_from("<q", data, entry + 16)[0]
    struct.pack_into("<q", data, entry + 16, end + 4)
    path.write_bytes(data + bytes(4))
    with pytest.raises(VolumeError, match=f"ends at byte {end}, the directory says {end + 4}"):
        read_vdb(path)


@pytest.mark.parametrize(
    "offsets", [(0, 0, 0), (-1, -1, -1), (1 << 62,) * 3, (10**6, 500, 900), (400, 10**9, 300)]
)
def test_absurd_grid_offsets_are_an_error_and_end_the_search(tmp_path, offsets):
    path = tmp_path / "offsets.vdb"
    data = bytearray(write_vdb(path, [small_grid(), GridSpec(name="other")]))
    struct.pack_into("<3q", data, data.index(b"Tree_float_5_4_3") + 20, *offsets)
    path.write_bytes(data)
    for grid in ("density", "other", "missing"):
        with pytest.raises(VolumeError):
            read_vdb(path, grid)
    with pytest.raises(VolumeError):
        list_vdb(path)


# The limit of memory.


def test_a_grid_beyond_max_bytes_is_refused_before_it_is_held():
    leaves = 875 * (2048 + 64 + 12)
    assert len(read_vdb(FIRE, max_bytes=leaves).leaf_values) == 875

    def read():
        with pytest.raises(
            VolumeError, match=f"875 leaves and 0 tiles need more than the limit of {leaves - 1}"
        ):
            read_vdb(FIRE, max_bytes=leaves - 1)

    assert peak_bytes(read) < leaves // 2


def test_reading_holds_little_more_than_the_grid_itself():
    held = []
    peak = peak_bytes(lambda: held.append(read_vdb(FIRE)))
    assert peak < 2.5 * held[0].leaf_values.nbytes + (4 << 20)


def test_tiles_count_against_max_bytes(tmp_path):
    path = tmp_path / "tiles.vdb"
    tiles = [((8 * i, 8 * j, 8 * k), 8, 1.0, True) for i in range(16) for j in range(16) for k in range(16)]
    write_vdb(path, [GridSpec(tiles=tiles)])
    assert read_vdb(path).active_voxels == 128**3
    with pytest.raises(VolumeError, match="0 leaves and 4096 tiles"):
        read_vdb(path, max_bytes=4096 * 21)


# What a user gets wrong, rather than the file.


def test_a_grid_that_does_not_exist_is_answered_with_those_that_do():
    with pytest.raises(VolumeError, match="no grid 'smoke'") as caught:
        read_vdb(FIRE, "smoke")
    for name in ("density", "flame", "temperature"):
        assert f"'{name}'" in caught.value.hint
    assert caught.value.where == str(FIRE)


@pytest.mark.parametrize(
    "kind", ["Tree_vec3i_5_4_3", "Tree_bool_5_4_3", "Tree_float_4_3", "Tree_vec2s_5_4_3_HalfFloat"]
)
def test_other_value_types_are_named(tmp_path, kind):
    write_vdb(tmp_path / "a.vdb", [GridSpec(grid_type=kind)])
    with pytest.raises(VolumeError, match=re.escape(f"{kind!r}, which is not supported")) as caught:
        read_vdb(tmp_path / "a.vdb")
    assert "float, double, half, int32, int64, vec3s, vec3d" in caught.value.hint
    assert "grid 'density'" in caught.value.where


@pytest.mark.parametrize("kind", ["NonlinearFrustumMap", "SomeMap"])
def test_transforms_that_are_not_affine_are_named(tmp_path, kind):
    write_vdb(tmp_path / "a.vdb", [GridSpec(transform=(kind, [1.0] * 40))])
    with pytest.raises(VolumeError, match=f"'{kind}' is not supported"):
        read_vdb(tmp_path / "a.vdb")


def test_a_file_without_offsets_an_orphan_instance_and_an_empty_file_are_named(tmp_path):
    write_vdb(tmp_path / "stream.vdb", [GridSpec()], has_offsets=False)
    with pytest.raises(VolumeError, match="without grid offsets"):
        read_vdb(tmp_path / "stream.vdb")
    write_vdb(tmp_path / "orphan.vdb", [GridSpec(parent="gone")])
    with pytest.raises(VolumeError, match="shares the tree of 'gone'"):
        read_vdb(tmp_path / "orphan.vdb")
    write_vdb(tmp_path / "none.vdb", [])
    with pytest.raises(VolumeError, match="no grids at all"):
        read_vdb(tmp_path / "none.vdb")
    assert list_vdb(tmp_path / "none.vdb") == []


def test_missing_empty_and_foreign_files_are_named(tmp_path):
    (tmp_path / "empty.vdb").touch()
    (tmp_path / "text.vdb").write_text("not a volume at all")
    for path, message in [
        (tmp_path / "gone.vdb", "no such file"),
        (tmp_path / "empty.vdb", "is empty"),
        (tmp_path, "is a folder"),
        (tmp_path / "text.vdb", "magic number"),
    ]:
        for read in (read_vdb, list_vdb):
            with pytest.raises(VolumeError, match=message) as caught:
                read(path)
            assert caught.value.where == str(path)


def test_names_from_a_file_cannot_break_the_line_of_an_error(tmp_path):
    write_vdb(tmp_path / "a.vdb", [GridSpec(name="two\nlines", grid_type="Tree_\n", transform=("a\nb", []))])
    for grid in ("two\nlines", "missing"):
        with pytest.raises(VolumeError) as caught:
            read_vdb(tmp_path / "a.vdb", grid)
        assert "\n" not in str(caught.value)
