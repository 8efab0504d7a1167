"""Volume files and arrays become the samples they hold, or one clear error; coefficients are checked."""

from __future__ import annotations

import io
import os
import random
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from vdb_writer import GridSpec, write_vdb

from clvol.errors import VolumeError
from clvol.volumes import (
    DenseGrid,
    SparseGrid,
    check_coefficients,
    dense_from_array,
    read_numpy,
    read_vdb,
    read_vol,
    read_volume,
    write_vol,
)
from clvol.volumes import check as check_module

DATA = os.environ.get("CLVOL_DATA")
needs_data = pytest.mark.skipif(not DATA, reason="CLVOL_DATA does not name the folder of test data")

BOX = np.array([[-1.0, 0.0, 2.0], [1.0, 0.5, 4.0]])
UNIT_BOX = [[0, 0, 0], [1, 1, 1]]


def ramp(*shape: int, dtype="f4") -> np.ndarray:
    """Distinct whole numbers, so that a swapped axis shows."""
    return np.arange(np.prod(shape)).reshape(shape).astype(dtype)


def peak_bytes(action) -> int:
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def refuses(action, message: str, path) -> VolumeError:
    """`action` raises a VolumeError of one line that says `message` and names the file."""
    with pytest.raises(VolumeError, match=message) as caught:
        action()
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    return caught.value


# Mitsuba's .vol


@pytest.mark.parametrize("shape", [(2, 3, 4), (2, 3, 4, 1), (2, 3, 4, 3)])
def test_vol_reads_back_what_was_written(tmp_path, shape):
    values = ramp(*shape)
    write_vol(tmp_path / "a.vol", values, BOX)
    read = read_vol(tmp_path / "a.vol")
    assert np.array_equal(read.values, values.reshape(2, 3, 4, -1))
    assert (read.values.dtype, read.values.flags.writeable) == (np.float32, False)
    assert read.values.flags.c_contiguous
    assert (read.box.tolist(), read.box.dtype) == (BOX.tolist(), np.float64)
    assert (read.name, read.source) == ("a", str(tmp_path / "a.vol"))


def test_vol_has_mitsubas_layout(tmp_path):
    write_vol(tmp_path / "a.vol", ramp(2, 3, 4, 3), BOX)
    data = (tmp_path / "a.vol").read_bytes()
    assert data[:4] == b"VOL\x03"
    assert struct.unpack_from("<5i6f", data, 4) == (1, 4, 3, 2, 3, -1, 0, 2, 1, 0.5, 4)
    x, y, z, channel = 3, 2, 1, 2
    place = 48 + 4 * (((z * 3 + y) * 4 + x) * 3 + channel)
    assert struct.unpack_from("<f", data, place)[0] == ramp(2, 3, 4, 3)[z, y, x, channel]
    assert len(data) == 48 + 4 * 72


@pytest.mark.parametrize(
    ("offset", "layout", "value", "message"),
    [
        (0, "B", 0, "does not start with VOL"),
        (3, "B", 2, "version 2"),
        (4, "i", 2, "type 2"),
        (20, "i", 6, "6 channels are not supported, 1 and 3 are"),
        (20, "i", 0, "0 channels"),
        (8, "i", 0, "size 0 x 3 x 2"),
        (8, "i", -4, "size -4 x 3 x 2"),
        (8, "i", 5, "need 168 bytes, the file has 144"),
        (16, "i", (1 << 31) - 1, "the file has 144"),
        (24, "f", np.nan, "box"),
        (24, "f", 1.0, "box"),
        (36, "f", np.inf, "box"),
    ],
)
def test_a_lie_in_a_vol_header_is_named(tmp_path, offset, layout, value, message):
    path = tmp_path / "a.vol"
    write_vol(path, ramp(2, 3, 4), BOX)
    data = bytearray(path.read_bytes())
    struct.pack_into("<" + layout, data, offset, value)
    path.write_bytes(data)
    assert peak_bytes(lambda: refuses(lambda: read_vol(path), message, path)) < 1 << 20


def test_a_vol_cut_anywhere_is_an_error(tmp_path):
    path = tmp_path / "a.vol"
    write_vol(path, ramp(2, 3, 4), BOX)
    for length in range(143, -1, -1):
        os.truncate(path, length)
        refuses(lambda: read_vol(path), ".", path)


def test_write_vol_refuses_what_mitsuba_could_not_read(tmp_path):
    for values, box in [
        (ramp(2, 3), BOX),
        (ramp(2, 3, 4, 2), BOX),
        (ramp(0, 3, 4), BOX),
        (ramp(2, 3, 4), BOX[::-1]),
        (ramp(2, 3, 4), BOX[0]),
    ]:
        refuses(lambda v=values, b=box: write_vol(tmp_path / "a.vol", v, b), "is no", tmp_path)
    assert not (tmp_path / "a.vol").exists()


# NumPy


def test_a_float32_npy_takes_no_more_than_its_size(tmp_path):
    np.save(tmp_path / "a.npy", ramp(2, 3, 4))
    read = read_numpy(tmp_path / "a.npy", max_bytes=0)
    assert np.array_equal(read.values, ramp(2, 3, 4, 1))
    assert not read.values.flags.writeable
    assert read.box.tolist() == UNIT_BOX
    assert (read.name, read.source) == ("a", str(tmp_path / "a.npy"))


@pytest.mark.parametrize("dtype", ["?", "i1", "u1", "<i2", ">i2", "u4", "i8", "f2", ">f4", "f8", "g"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_every_real_dtype_and_order_becomes_float32(tmp_path, dtype, order):
    values = np.asarray(ramp(2, 3, 4, 3) % 2 if dtype == "?" else ramp(2, 3, 4, 3)).astype(dtype, order=order)
    np.save(tmp_path / "a.npy", values)
    np.savez_compressed(tmp_path / "a.npz", a=values)
    for read in (read_numpy(tmp_path / "a.npy"), read_numpy(tmp_path / "a.npz"), dense_from_array(values)):
        assert read.values.dtype == np.float32
        assert read.values.flags.c_contiguous
        assert np.array_equal(read.values, values.astype("f4"))


def test_fortran_order_float32_is_not_mistaken_for_c_order(tmp_path):
    np.save(tmp_path / "a.npy", np.asfortranarray(ramp(2, 3, 4)))
    assert np.array_equal(read_numpy(tmp_path / "a.npy").values, ramp(2, 3, 4, 1))


def test_npz_needs_a_name_only_where_there_are_several_arrays(tmp_path):
    np.savez(tmp_path / "one.npz", smoke=ramp(2, 3, 4))
    one = read_numpy(tmp_path / "one.npz")
    assert (one.name, one.source) == ("smoke", str(tmp_path / "one.npz"))
    path = tmp_path / "two.npz"
    np.savez(path, smoke=ramp(2, 3, 4), heat=ramp(2, 3, 4) + 1)
    assert read_numpy(path, "heat").values[0, 0, 0] == 1
    assert "'smoke', 'heat'" in refuses(lambda: read_numpy(path), "holds 2 arrays", path).hint
    assert "'smoke', 'heat'" in refuses(lambda: read_numpy(path, "fog"), "no array 'fog'", path).hint


@needs_data
def test_ct_scan_of_a_stent_is_read():
    read = read_numpy(Path(DATA) / "stent.npz")
    assert read.values.shape == (256, 128, 128, 1)
    assert read.values.dtype == np.float32
    with np.load(Path(DATA) / "stent.npz") as archive:
        (name,) = archive.files
        scan = archive[name]
    assert (scan.dtype, read.name) == (np.int16, name)
    assert np.array_equal(read.values[..., 0], scan)
    check_coefficients(read)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.ones((2, 3, 4), "c8"), "complex64|real numbers"),
        (np.array([[["a"]]]), "real numbers"),
        (np.array([[[{}]]]), "real numbers"),
        (np.zeros((2, 2, 2), "M8[s]"), "real numbers"),
        (np.zeros((2, 2, 2), [("a", "f4")]), "real numbers"),
        (np.ones((3, 4)), "2 axes"),
        (np.ones((1, 2, 3, 4, 5)), "5 axes"),
        (np.ones((2, 3, 4, 2)), "has 1 or 3 channels, not 2"),
        (np.ones((2, 3, 4, 6)), "has 1 or 3 channels, not 6"),
        (np.ones((2, 0, 4)), "no samples"),
        (np.float32(1), "0 axes|not that of an array"),
    ],
)
def test_arrays_that_are_no_volumes_are_refused_wherever_they_come_from(tmp_path, array, message):
    np.save(tmp_path / "a.npy", array)
    np.savez(tmp_path / "a.npz", a=array)
    refuses(lambda: read_numpy(tmp_path / "a.npy"), message, tmp_path)
    refuses(lambda: read_numpy(tmp_path / "a.npz"), message, tmp_path)
    refuses(lambda: dense_from_array(array, "data", "here.xml"), message, "here.xml, grid 'data'")


def test_dense_from_array_takes_lists_and_refuses_ragged_ones():
    assert dense_from_array([[[1, 2]]]).values.shape == (1, 1, 2, 1)
    refuses(lambda: dense_from_array([[[1], [1, 2]]], "data"), "not an array", "grid 'data'")


class Bomb:
    """Unpickled, it would fail the test."""

    def __reduce__(self):
        return pytest.fail, ("a pickle was loaded",)


def test_pickles_are_never_loaded(tmp_path):
    array = np.empty((1, 1, 1), object)
    array[0, 0, 0] = Bomb()
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    np.savez(tmp_path / "a.npz", a=array)
    refuses(lambda: read_numpy(tmp_path / "a.npy"), "real numbers", tmp_path)
    refuses(lambda: read_numpy(tmp_path / "a.npz"), "real numbers", tmp_path)


def npy(header: str, data: bytes = b"", version: int = 1) -> bytes:
    width = "<H" if version == 1 else "<I"
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack(width, len(header)) + header.encode() + data


HEADERS = {
    "shape beyond the file": "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000, 1000), }",
    "shape beyond 64 bits": "{'descr': '<f4', 'fortran_order': False, 'shape': (" + "9" * 300 + ", 1, 1), }",
    "negative shape": "{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 2, 2), }",
    "no shape": "{'descr': '<f4', 'fortran_order': False, }",
    "unknown size": "{'descr': '<f3', 'fortran_order': False, 'shape': (1, 1, 1), }",
    "code": "{'descr': '<f4', 'fortran_order': __import__('os'), 'shape': (1, 1, 1), }",
    "nesting": "(" * 9000,
    "digits": "{'descr': '<f4', 'fortran_order': False, 'shape': (" + "1" * 9000,
    "nothing": "",
}


@pytest.mark.parametrize("header", HEADERS.values(), ids=HEADERS.keys())
def test_a_lie_in_a_numpy_header_is_an_error_and_costs_no_memory(tmp_path, header):
    (tmp_path / "a.npy").write_bytes(npy(header, bytes(64)))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", npy(header, bytes(64)))

    def read_both():
        for name in ("a.npy", "a.npz"):
            refuses(lambda n=name: read_numpy(tmp_path / n), ".", tmp_path / name)

    assert peak_bytes(read_both) < 1 << 20


def test_a_header_length_beyond_the_file_is_an_error(tmp_path):
    (tmp_path / "a.npy").write_bytes(b"\x93NUMPY\x02\x00\xff\xff\xff\xff{'descr'")
    refuses(lambda: read_numpy(tmp_path / "a.npy"), "damaged", tmp_path)


def test_conversions_beyond_max_bytes_are_refused(tmp_path):
    for dtype, order, needed in (("i2", "C", 256), ("f4", "F", 256)):
        np.save(tmp_path / "a.npy", ramp(4, 4, 4).astype(dtype, order=order))
        assert read_numpy(tmp_path / "a.npy", max_bytes=needed).values.size == 64
        refuses(
            lambda n=needed: read_numpy(tmp_path / "a.npy", max_bytes=n - 1), "the limit is 255", tmp_path
        )
    np.savez(tmp_path / "a.npz", ramp(4, 4, 4).astype("i2"))
    assert read_numpy(tmp_path / "a.npz", max_bytes=256).values.size == 64
    refuses(lambda: read_numpy(tmp_path / "a.npz", max_bytes=255), "the limit is 255", tmp_path)


def test_an_npz_bomb_is_refused_by_the_limit_before_it_is_inflated(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros((256, 256, 256), "f4"))

    def read():
        refuses(lambda: read_numpy(tmp_path / "a.npz", max_bytes=32 << 20), "limit", tmp_path)

    assert peak_bytes(read) < 1 << 20


def test_an_array_cannot_be_longer_than_its_archive_member(tmp_path):
    whole = io.BytesIO()
    np.save(whole, ramp(8, 8, 8))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", whole.getvalue()[:-4])
    refuses(lambda: read_numpy(tmp_path / "a.npz"), "need 2048 bytes, the array has 2044", tmp_path)


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
def test_damaged_numpy_files_are_an_error_or_a_valid_grid(tmp_path, suffix):
    path, places = tmp_path / f"a{suffix}", random.Random(5)
    save = np.save if suffix == ".npy" else np.savez_compressed
    save(path, ramp(6, 7, 8) % 9)
    data = path.read_bytes()
    for _ in range(200):
        path.write_bytes(data[: places.randrange(len(data))])
        refuses(lambda: read_numpy(path), ".", path)
    errors = 0
    for _ in range(600):
        broken = bytearray(data)
        broken[places.randrange(len(data))] ^= places.randrange(1, 256)
        path.write_bytes(broken)
        try:
            read = read_numpy(path)
            check_coefficients(read)
        except VolumeError as error:
            errors += 1
            assert str(path) in str(error)
        else:
            assert np.isfinite(read.values).all()
    assert errors > 20


def test_other_files_are_not_taken_for_numpy(tmp_path):
    (tmp_path / "a.npy").write_bytes(b"something else")
    refuses(lambda: read_numpy(tmp_path / "a.npy"), "neither", tmp_path)
    np.save(tmp_path / "b.npy", ramp(2, 2, 2))
    refuses(lambda: read_numpy(tmp_path / "b.npy", "density"), "no array named 'density'", tmp_path)
    refuses(lambda: read_numpy(tmp_path / "gone.npy"), "no such file", tmp_path)


# Any file


def test_read_volume_goes_by_the_suffix(tmp_path):
    values = ramp(2, 3, 4)
    write_vol(tmp_path / "a.VOL", values, BOX)
    np.save(tmp_path / "a.npy", values)
    np.savez(tmp_path / "a.npz", a=values, b=values + 1)
    tile = ((0, 0, 0), 8, 1, True)
    write_vdb(tmp_path / "a.vdb", [GridSpec(name="heat", tiles=[tile]), GridSpec(tiles=[tile])])
    assert isinstance(read_volume(tmp_path / "a.VOL"), DenseGrid)
    assert isinstance(read_volume(str(tmp_path / "a.npy")), DenseGrid)
    assert read_volume(tmp_path / "a.npz", "b").values[0, 0, 0] == 1
    assert isinstance(read_volume(tmp_path / "a.vdb"), SparseGrid)
    assert read_volume(tmp_path / "a.vdb").name == "density"
    assert read_volume(tmp_path / "a.vdb", "heat").name == "heat"
    refuses(lambda: read_volume(tmp_path / "a.VOL", "density"), "no grid named 'density'", "a.VOL")


@pytest.mark.parametrize("name", ["a.exr", "a.raw", "a"])
def test_read_volume_says_what_it_reads(name):
    refuses(lambda: read_volume(name), r"\.vdb, \.nvdb, \.vol, \.npy, \.npz, .* can", name)


# Coefficients


def dense(values) -> DenseGrid:
    return dense_from_array(np.asarray(values, "f4"), "smoke", "a.npy")


def test_finite_values_from_zero_up_are_coefficients():
    check_coefficients(dense(ramp(3, 4, 5)))
    check_coefficients(dense(np.zeros((3, 4, 5))))


@pytest.mark.parametrize("slab", [1 << 22, 7])
def test_faults_are_counted_whatever_the_slab(monkeypatch, slab):
    monkeypatch.setattr(check_module, "SLAB", slab)
    values = np.ones((3, 4, 5))
    values[0, 0, :3] = np.nan, np.inf, -np.inf
    error = refuses(
        lambda: check_coefficients(dense(values)), "density has 3 NaN or infinite of 60", "grid 'smoke'"
    )
    assert error.where == "a.npy, grid 'smoke'"
    values[2, 3, 1:] = -0.5, -2, -0.25, 0
    message = r"albedo has 3 NaN or infinite and 3 negative \(minimum -2\) of 60 samples"
    refuses(lambda: check_coefficients(dense(values), "albedo"), message, "a.npy")
    values[0, 0, :3] = 1
    refuses(
        lambda: check_coefficients(dense(values)), r"density has 3 negative \(minimum -2\) of 60", "a.npy"
    )


def test_checking_takes_no_memory_of_the_volumes_size(monkeypatch):
    monkeypatch.setattr(check_module, "SLAB", 1 << 16)
    values = np.ones((64, 256, 256), "f4")
    values[::2, 0, 0] = np.nan
    values[1::2, 0, 0] = -1
    grid = dense(values)
    peak = peak_bytes(
        lambda: refuses(lambda: check_coefficients(grid), "32 NaN or infinite and 32 negative", "a.npy")
    )
    assert peak < 1 << 20


def test_a_grid_without_samples_is_empty():
    grid = DenseGrid(np.empty((0, 3, 4, 1), "f4"), np.array(UNIT_BOX), "smoke", "a.npy")
    refuses(lambda: check_coefficients(grid), "density has no samples", "a.npy")


def sparse(path, **options) -> SparseGrid:
    write_vdb(path, [GridSpec(**options)])
    return read_vdb(path)


def test_leaves_tiles_and_background_are_all_checked(tmp_path):
    path = tmp_path / "a.vdb"
    on, off = np.ones((8, 8, 8), bool), np.zeros((8, 8, 8), bool)
    good = {(0, 0, 0): (np.ones((8, 8, 8)), on)}
    check_coefficients(sparse(path, leaves=good, tiles=[((8, 0, 0), 8, 2, True)]))
    refuses(lambda: check_coefficients(sparse(path, leaves=good, background=-1)), "1 negative", path)
    for active in (True, False):
        grid = sparse(path, leaves=good, tiles=[((8, 0, 0), 8, np.nan, active)])
        refuses(lambda g=grid: check_coefficients(g), "1 NaN or infinite of 514 samples", path)
    grid = sparse(path, leaves={**good, (8, 0, 0): (np.full((8, 8, 8), -3.0), off)})
    refuses(lambda: check_coefficients(grid), r"512 negative \(minimum -3\) of 1025 samples", path)


def test_a_vdb_without_active_voxels_is_empty(tmp_path):
    path = tmp_path / "a.vdb"
    off = np.zeros((8, 8, 8), bool)
    for leaves in ({}, {(0, 0, 0): (np.ones((8, 8, 8)), off)}):
        grid = sparse(path, leaves=leaves, tiles=[((8, 0, 0), 8, 1, False)])
        refuses(lambda g=grid: check_coefficients(g), "density has no active voxels", path)


BEYOND, NOTHING = r"up to 1e\+300, beyond single precision", "no value above 1e-300, which is 0 in single"


@pytest.mark.parametrize(("value", "message"), [(1e300, BEYOND), (1e-300, NOTHING)])
def test_doubles_that_no_float32_is_are_told_from_nan_and_from_nothing(tmp_path, value, message):
    path = tmp_path / "a.vdb"
    refuses(lambda: sparse(path, value_type="double", tiles=[((8, 0, 0), 8, value, True)]), message, path)
    leaves = {(8, 0, 0): (np.full((8, 8, 8), value), np.ones((8, 8, 8), bool))}
    refuses(lambda: sparse(path, value_type="double", leaves=leaves), message, path)
    for order in "CF":
        np.save(tmp_path / "a.npy", np.full((1, 1, 2), value, order=order))
        refuses(lambda: read_numpy(tmp_path / "a.npy"), message, tmp_path)
    array = np.full((2, 3, 4), value)
    refuses(lambda: dense_from_array(array, source="a"), message, "a")
    refuses(lambda: dense_from_array(np.ma.masked_less(array, 0), source="a"), message, "a")


def test_beside_others_tiny_doubles_are_0_and_infinite_ones_are_counted():
    grid = dense_from_array(np.array([[[1.0, 1e-300, 0.0]]]))
    np.testing.assert_array_equal(grid.values.reshape(-1), [1, 0, 0])
    assert not dense_from_array(np.zeros((1, 1, 2))).values.any()
    infinite = dense_from_array(np.array([[[1.0, np.inf, np.nan]]]))
    with pytest.raises(VolumeError, match="2 NaN or infinite of 3"):
        check_coefficients(infinite)
    with pytest.raises(VolumeError, match="which is 0 in single precision"):
        check_coefficients(dense_from_array(np.full((1, 1, 2), 1e-40, np.float32)))
