"""The OpenVDB reader gives what OpenVDB wrote: real files' figures, every way a value is stored."""

from __future__ import annotations

import os
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from places import SCENES
from rich_vdb import INACTIVE, STORED_TYPES, leaf, rich_grid
from vdb_writer import ACTIVE_MASK, BLOSC, ZIP, GridSpec, inactive_code, write_vdb
from volume_samples import active_samples, samples_in_box

from clvol.errors import VolumeError
from clvol.volumes import check_coefficients, list_vdb, read_vdb

FIRE = SCENES / "fire.vdb"
DATA = os.environ.get("CLVOL_DATA")
needs_data = pytest.mark.skipif(not DATA, reason="CLVOL_DATA does not name the folder of test data")


def data_file(name: str) -> Path:
    return Path(DATA) / name


def spans(box) -> list[list[int]]:
    return np.asarray(box).tolist()


@pytest.fixture(scope="module")
def fire():
    return read_vdb(FIRE)


# Real files. The figures are OpenVDB's own (vdb_print, pyopenvdb).


def test_fire_density_has_openvdbs_box_count_maximum_and_sum(fire):
    values, counts = active_samples(fire)
    assert spans(fire.active_box) == [[5, 3, 7], [75, 74, 125]]
    assert fire.active_voxels == counts.sum() == 290_395
    assert values.max() == np.float32(np.float16(0.8003))
    assert (values.astype(np.float64) * counts).sum() == pytest.approx(69_093.67852586508, rel=1e-12)
    assert len(fire.leaf_values) == 875
    assert fire.background == 0
    assert (fire.name, fire.source) == ("density", str(FIRE))
    assert np.allclose(np.diag(fire.index_to_world), [0.0417829457] * 3 + [1], rtol=1e-7)


@pytest.mark.parametrize(
    ("grid", "active", "largest"), [("flame", 145_954, 0.9951171875), ("temperature", 290_275, 2.9921875)]
)
def test_fire_has_openvdbs_flame_and_temperature(grid, active, largest):
    read = read_vdb(FIRE, grid)
    assert read.active_voxels == active
    assert read.leaf_values.max() == np.float32(largest)
    check_coefficients(read)


def test_fire_arrays_have_the_documented_types_and_hold_no_stray_values(fire):
    count = len(fire.leaf_values)
    layout = {
        "leaf_origins": (np.int32, (count, 3)),
        "leaf_values": (np.float32, (count, 8, 8, 8, 1)),
        "leaf_active": (np.uint8, (count, 64)),
        "tile_origins": (np.int32, (0, 3)),
        "tile_sizes": (np.int32, (0,)),
        "tile_values": (np.float32, (0, 1)),
        "tile_active": (np.bool_, (0,)),
        "index_to_world": (np.float64, (4, 4)),
        "active_box": (np.int32, (2, 3)),
    }
    for name, (dtype, shape) in layout.items():
        array = getattr(fire, name)
        assert (array.dtype, array.shape) == (dtype, shape), name
    assert not (fire.leaf_origins % 8).any()
    check_coefficients(fire)


@needs_data
@pytest.mark.parametrize(
    ("grid", "active", "total", "largest"),
    [
        ("density", 14_986, 4_630.033576130867, 0.9970703125),
        ("flame", 11_010, 5_737.988259971142, 0.99560546875),
        ("shadow", 50_225, 31_025.06562590599, 1.0),
        ("temperature", 14_983, 21_487.34625083208, 2.994140625),
    ],
)
def test_fire_small_has_openvdbs_figures(grid, active, total, largest):
    read = read_vdb(data_file("fire_small.vdb"), grid)
    values, counts = active_samples(read)
    assert read.active_voxels == active
    assert (values.astype(np.float64) * counts).sum() == pytest.approx(total, rel=1e-12)
    assert values.max() == np.float32(largest)


@needs_data
def test_box_fog_is_one_inside_and_outside():
    fog = read_vdb(data_file("box_fog.vdb"))
    assert fog.background == 1
    assert spans(fog.active_box) == [[-10] * 3, [10] * 3]
    assert fog.active_voxels == 21**3
    assert (samples_in_box(fog, [-40] * 3, [40] * 3) == 1).all()


@needs_data
def test_cloud_keeps_its_active_tiles():
    cloud = read_vdb(data_file("wdas_cloud_sixteenth.vdb"))
    values, counts = active_samples(cloud)
    assert (cloud.active_box[1] - cloud.active_box[0] + 1).tolist() == [126, 86, 154]
    assert cloud.tile_active.sum() == 130
    assert cloud.active_voxels == counts.sum() == 415_642
    assert (values.astype(np.float64) * counts).sum() == pytest.approx(188_542.10390198568, rel=1e-12)
    assert (values.min(), values.max()) == (0, 1)


def test_fire_is_read_leaf_by_leaf_and_not_voxel_by_voxel():
    """What takes a call of its own are leaves, of 512 voxels each: 37 calls a leaf."""
    calls = Counter()
    previous = sys.getprofile()
    sys.setprofile(lambda _frame, event, _argument: calls.update([event]))
    try:
        leaves = len(read_vdb(FIRE).leaf_values)
    finally:
        sys.setprofile(previous)
    assert leaves < calls["call"] + calls["c_call"] < 60 * leaves


# Synthetic files: everything the format allows.


@pytest.mark.parametrize("code", range(7))
def test_sample_leaves_cover_every_code(code):
    values, active = leaf(INACTIVE[code], code)
    assert inactive_code(values[~active], np.array(2.0))[0] == code


@pytest.mark.parametrize(("value_type", "half"), STORED_TYPES)
@pytest.mark.parametrize("mask", [0, ACTIVE_MASK])
@pytest.mark.parametrize("codec", [0, ZIP, BLOSC, ZIP | BLOSC])
def test_every_storage_reads_back_exactly(tmp_path, value_type, half, mask, codec):
    spec = rich_grid(value_type=value_type, half=half, compression=mask | codec)
    write_vdb(tmp_path / "a.vdb", [spec])
    read = read_vdb(tmp_path / "a.vdb")
    stored = {tuple(o): i for i, o in enumerate(read.leaf_origins.tolist())}
    assert set(stored) == set(spec.leaves)
    for origin, (values, active) in spec.leaves.items():
        expected = values.reshape(8, 8, 8, -1).transpose(2, 1, 0, 3)
        assert np.array_equal(read.leaf_values[stored[origin]], expected), origin
        bits = np.unpackbits(read.leaf_active[stored[origin]], bitorder="little").reshape(8, 8, 8)
        assert np.array_equal(bits, active), origin
    columns = (read.tile_origins.tolist(), read.tile_sizes, read.tile_values, read.tile_active)
    tiles = sorted((tuple(o), s, tuple(v), a) for o, s, v, a in zip(*columns, strict=True))
    assert tiles == sorted((o, s, tuple(np.ravel(v)), a) for o, s, v, a in spec.tiles)
    assert read.background.tolist() == np.ravel(spec.background).tolist()


@pytest.mark.parametrize(("value_type", "value"), [("float", 0.5), ("double", 0.5), ("int64", 5)])
def test_root_tiles_are_kept_active_or_not(tmp_path, value_type, value):
    tiles = [((-4096, 4096, 0), 4096, value, True), ((0, 4096, 0), 4096, 1, False)]
    write_vdb(tmp_path / "a.vdb", [GridSpec(value_type=value_type, tiles=tiles)])
    read = read_vdb(tmp_path / "a.vdb")
    assert read.tile_origins.tolist() == [[-4096, 4096, 0], [0, 4096, 0]]
    assert (read.tile_sizes.tolist(), read.tile_values.tolist()) == ([4096, 4096], [[value], [1]])
    assert read.active_voxels == 4096**3
    assert spans(read.active_box) == [[-4096, 4096, 0], [-1, 8191, 4095]]


def test_values_are_delivered_z_slowest(tmp_path):
    x, y, z = np.meshgrid(*[np.arange(8)] * 3, indexing="ij")
    write_vdb(tmp_path / "a.vdb", [GridSpec(leaves={(8, 16, 24): (x + 10 * y + 100 * z, x >= 0)})])
    read = read_vdb(tmp_path / "a.vdb")
    assert read.leaf_values[0, 3, 2, 1].item() == 321
    assert samples_in_box(read, (8 + 1, 16 + 2, 24 + 3), (8 + 1, 16 + 2, 24 + 3)).item() == 321


def test_inactive_values_of_half_grids_keep_full_width(tmp_path):
    values, active = leaf([0.1], 1)
    values[active] = 0.1
    write_vdb(
        tmp_path / "a.vdb",
        [GridSpec(half=True, compression=ACTIVE_MASK, leaves={(0, 0, 0): (values, active)})],
    )
    read = read_vdb(tmp_path / "a.vdb").leaf_values[0, ..., 0].transpose(2, 1, 0)
    assert (read[~active] == np.float32(0.1)).all()
    assert (read[active] == np.float32(np.float16(0.1))).all()


def test_what_is_half_is_said_by_metadata_as_openvdb_reads_it(tmp_path):
    values, active = leaf([2], 3)
    for options in (
        {"value_type": "int32", "half": True, "grid_type": "Tree_int32_5_4_3_HalfFloat"},
        {"value_type": "float", "half": False, "grid_type": "Tree_float_5_4_3_HalfFloat"},
        {"value_type": "float", "half": True, "grid_type": "Tree_float_5_4_3"},
    ):
        spec = GridSpec(background=2, leaves={(0, 0, 0): (values, active)}, **options)
        write_vdb(tmp_path / "a.vdb", [spec])
        read = read_vdb(tmp_path / "a.vdb").leaf_values[0, ..., 0]
        assert np.array_equal(read, values.transpose(2, 1, 0)), options
        halved = options["half"] and options["value_type"] == "float"
        assert list_vdb(tmp_path / "a.vdb")[0].half == halved


def test_active_box_is_that_of_active_samples_only(tmp_path):
    values, active = np.ones((8, 8, 8)), np.zeros((8, 8, 8), bool)
    active[1:3, 4, 5:7] = True
    nothing = np.zeros((8, 8, 8), bool)
    leaves = {(-8, 0, 8): (values, active), (-80, 0, 0): (values, nothing), (80, 0, 0): (values, nothing)}
    spec = GridSpec(leaves=leaves, tiles=[((800, 0, 0), 8, 1, False)])
    write_vdb(tmp_path / "a.vdb", [spec])
    assert spans(read_vdb(tmp_path / "a.vdb").active_box) == [[-7, 4, 13], [-6, 4, 14]]
    spec.tiles.append(((-128, 128, 0), 128, 1, True))
    write_vdb(tmp_path / "a.vdb", [spec])
    assert spans(read_vdb(tmp_path / "a.vdb").active_box) == [[-128, 4, 0], [-1, 255, 127]]


def test_a_grid_without_voxels_reads_as_empty(tmp_path):
    write_vdb(tmp_path / "a.vdb", [GridSpec(background=0.5)])
    read = read_vdb(tmp_path / "a.vdb")
    assert read.active_voxels == 0
    assert (read.active_box[1] < read.active_box[0]).all()


SCALE = [2.0, 3.0, 4.0]
MOVE = [5.0, 6.0, 7.0]
SCALED = np.diag([*SCALE, 1])
MOVED = np.array([[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1.0]])
ROTATED = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.mark.parametrize(
    ("name", "doubles", "matrix"),
    [
        ("UniformScaleMap", [2.0] * 3 + [99.0] * 12, np.diag([2, 2, 2, 1])),
        ("ScaleMap", SCALE + [99.0] * 12, SCALED),
        ("ScaleTranslateMap", MOVE + SCALE + [99.0] * 12, MOVED @ SCALED),
        ("UniformScaleTranslateMap", MOVE + [2.0] * 3 + [99.0] * 12, MOVED @ np.diag([2, 2, 2, 1])),
        ("TranslationMap", MOVE, MOVED),
        ("UnitaryMap", ROTATED.T.ravel().tolist(), ROTATED),
        ("AffineMap", (MOVED @ ROTATED @ SCALED).T.ravel().tolist(), MOVED @ ROTATED @ SCALED),
    ],
)
def test_every_affine_map_becomes_its_matrix(tmp_path, name, doubles, matrix):
    write_vdb(tmp_path / "a.vdb", [rich_grid(transform=(name, doubles))])
    assert np.array_equal(read_vdb(tmp_path / "a.vdb").index_to_world, matrix)
    (info,) = list_vdb(tmp_path / "a.vdb")
    assert info.transform == name
    assert np.array_equal(info.index_to_world, matrix)


def constant(name: str, value: float, **options) -> GridSpec:
    return GridSpec(name=name, tiles=[((0, 0, 0), 8, value, True)], **options)


def test_grids_are_found_by_name_wherever_they_are_and_cut_at_0x1e(tmp_path):
    grids = [constant("heat", 1), constant("density", 2, suffix="0"), constant("density", 3, suffix="1")]
    write_vdb(tmp_path / "a.vdb", grids)
    assert read_vdb(tmp_path / "a.vdb", "heat").tile_values == [1]
    first = read_vdb(tmp_path / "a.vdb", "density")
    assert (first.name, first.tile_values) == ("density", [2])
    assert read_vdb(tmp_path / "a.vdb", "density\x1e1").tile_values == [3]


@pytest.mark.parametrize("order", [1, -1])
def test_an_instance_shares_the_tree_of_its_parent_under_its_own_transform(tmp_path, order):
    shared = GridSpec(name="copy", parent="density", transform=("TranslationMap", MOVE))
    write_vdb(tmp_path / "a.vdb", [constant("density", 2), shared][::order])
    copy = read_vdb(tmp_path / "a.vdb", "copy")
    assert (copy.name, copy.tile_values) == ("copy", [2])
    assert np.array_equal(copy.index_to_world, MOVED)


def test_list_tells_what_the_file_says_without_reading_trees(tmp_path):
    def metadata(voxels):
        box = [np.array(corner, "<i4").tobytes() for corner in ([-1, 2, 3], [4, 5, 6])]
        return [
            ("file_bbox_min", "vec3i", box[0]),
            ("file_bbox_max", "vec3i", box[1]),
            ("__delayedload", "__delayedload", bytes(5000)),
            ("file_voxel_count", "int64", np.array(voxels, "<i8").tobytes()),
        ]

    frustum = ("NonlinearFrustumMap", [1.0] * 30)
    grids = [
        rich_grid(name="a", half=True, compression=BLOSC | ACTIVE_MASK, metadata=metadata(77)),
        GridSpec(
            name="v", grid_type="Tree_vec3s_5_4_3_HalfFloat", half=True, compression=ZIP, transform=frustum
        ),
        GridSpec(name="p", grid_type="Tree_ptdataidx32_5_4_3"),
    ]
    data = bytearray(write_vdb(tmp_path / "a.vdb", grids))
    # Ruin the first tree: 64 bytes right before the next grid's entry.
    end = data.index(b"\x01\x00\x00\x00v")
    data[end - 64 : end] = b"\xff" * 64
    (tmp_path / "a.vdb").write_bytes(data)
    with pytest.raises(VolumeError):
        read_vdb(tmp_path / "a.vdb", "a")
    a, v, p = list_vdb(tmp_path / "a.vdb")
    assert (a.name, a.value_type, a.half, a.compression) == ("a", "float", True, ("active mask", "blosc"))
    assert (spans(a.active_box), a.active_voxels) == ([[-1, 2, 3], [4, 5, 6]], 77)
    assert (v.name, v.value_type, v.half, v.compression) == ("v", "vec3s", True, ("zip",))
    assert (v.transform, v.index_to_world) == ("NonlinearFrustumMap", None)
    assert (p.value_type, p.active_box, p.active_voxels) == ("ptdataidx32", None, None)


def test_fires_metadata_agree_with_its_trees():
    for info in list_vdb(FIRE):
        read = read_vdb(FIRE, info.name)
        assert info.active_voxels == read.active_voxels
        assert spans(info.active_box) == spans(read.active_box)
        assert (info.value_type, info.half, info.compression) == ("float", True, ("active mask", "blosc"))
        assert np.array_equal(info.index_to_world, read.index_to_world)


def test_file_versions_222_to_224_are_read_and_225_with_a_warning(tmp_path):
    for version in (222, 223, 224):
        write_vdb(tmp_path / "a.vdb", [rich_grid()], version)
        assert read_vdb(tmp_path / "a.vdb").background == 2
    write_vdb(tmp_path / "a.vdb", [rich_grid()], 225)
    with pytest.warns(UserWarning, match="version 225"):
        assert read_vdb(tmp_path / "a.vdb").background == 2
