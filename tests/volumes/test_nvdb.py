"""NanoVDB files: what the library itself wrote, and what a writer of the tests' own wrote, is read as it is.

The files of cases/nvdb are NanoVDB's (32.4.2), and the values that it finds in them.
"""

from __future__ import annotations

import os
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nvdb_writer import (
    BLOSC,
    LAYOUTS,
    NONE,
    ZIP,
    grid_bytes,
    packed,
    stored_values,
    version_number,
    write_nvdb,
)
from places import CASES
from rich_vdb import as_vectors, rich_grid
from vdb_writer import GridSpec, write_vdb
from volume_samples import probe

from clvol.errors import VolumeError
from clvol.scene.describe import describe_volume
from clvol.volumes import list_grids, list_nvdb, read_nvdb, read_vdb, read_volume
from clvol.volumes.nvdb_layout import READABLE, Layout

FILES = CASES / "nvdb"
LETTERS = {"Int16": "int32", "Int32": "int32", "Int64": "int64", "UInt32": "int32", "UInt8": "int32"}
STORED = {
    "zip.nvdb": ["Float", "Fp16", "Vec3f", "Double", "Int32", "Vec3d"],
    "blosc.nvdb": ["Fp4", "Fp8", "FpN", "Int16"],
}


@pytest.mark.parametrize(("file", "name"), [(file, name) for file in STORED for name in STORED[file]])
def test_the_reader_finds_what_nanovdb_finds(file, name):
    (info,) = [info for info in list_nvdb(FILES / file) if info.name == name]
    read = read_nvdb(FILES / file, name)
    with np.load(FILES / "probes.npz") as known:
        values, active = probe(read, known["places"].astype(int))
        assert np.array_equal(values, known[f"{name}_values"])
        assert np.array_equal(active, known[f"{name}_active"])
    assert (info.value_type, info.channels, info.compression) == (name, read.channels, (file[:-5],))
    assert (info.active_voxels, info.active_box.tolist()) == (read.active_voxels, read.active_box.tolist())
    assert np.array_equal(
        read.index_to_world, [[0.25, 0, 0, 1], [0, 0.25, 0, 2], [0, 0, 0.25, 3], [0, 0, 0, 1]]
    )
    assert read.kind == ("fog volume" if name in ("Float", "Double", "Fp4", "Fp8", "Fp16", "FpN") else "")


@pytest.mark.parametrize("kind", LAYOUTS)
def test_nodes_are_laid_out_as_nanovdbs_table_says(kind):
    number, *offsets = LAYOUTS[kind]
    layout = Layout.of(READABLE[kind])
    found = [layout.background, layout.root, layout.tile_value, layout.tile, layout.entry]
    found += [
        layout.upper_table,
        layout.upper,
        layout.lower_table,
        layout.lower,
        layout.leaf_values,
        layout.leaf,
    ]
    assert (READABLE[kind].value.str.strip("<|"), found) == (number.strip("<"), offsets)


def rich(kind: str) -> GridSpec:
    """Leaves, tiles of each size, a background of 2; of as many channels as the type has."""
    spec = rich_grid(value_type=LETTERS.get(kind, "float"))
    spec.tiles = [*spec.tiles, ((8192, 0, 0), 4096, 3, True)]
    if kind in ("UInt32", "UInt8"):
        spec.leaves = {place: (abs(values), active) for place, (values, active) in spec.leaves.items()}
    return as_vectors(spec) if kind in ("Vec3f", "Vec3d") else spec


def assert_holds(read, spec: GridSpec, kind: str) -> None:
    """A grid has exactly the leaves, tiles and background that were written."""
    stored = {tuple(origin): number for number, origin in enumerate(read.leaf_origins.tolist())}
    assert set(stored) == set(spec.leaves)
    for number, (origin, (values, active)) in enumerate(spec.leaves.items()):
        expected = stored_values(values, kind, number).reshape(8, 8, 8, -1).transpose(2, 1, 0, 3)
        assert np.array_equal(read.leaf_values[stored[origin]], expected), origin
        bits = np.unpackbits(read.leaf_active[stored[origin]], bitorder="little").reshape(8, 8, 8)
        assert np.array_equal(bits, active), origin
    columns = (read.tile_origins, read.tile_sizes, read.tile_values, read.tile_active)
    tiles = sorted(
        (tuple(o.tolist()), int(s), tuple(v), bool(a)) for o, s, v, a in zip(*columns, strict=True)
    )
    assert tiles == sorted((o, s, tuple(np.ravel(v)), a) for o, s, v, a in spec.tiles)
    assert read.background.tolist() == np.ravel(spec.background).tolist()


@pytest.mark.parametrize("codec", [NONE, ZIP, BLOSC])
@pytest.mark.parametrize("kind", LAYOUTS)
def test_every_type_in_every_codec_is_read_as_it_was_written(tmp_path, kind, codec):
    spec = rich(kind)
    write_nvdb(tmp_path / "a.nvdb", [spec], kind, codec)
    assert_holds(read_nvdb(tmp_path / "a.nvdb"), spec, kind)


def test_a_nanovdb_of_floats_is_the_openvdb_of_the_same_grid(tmp_path):
    spec = rich_grid(transform=("AffineMap", [0, 2, 0, 0, -3, 0, 0, 0, 0, 0, 4, 0, 5, 6, 7, 1]))
    write_nvdb(tmp_path / "a.nvdb", [spec], codec=BLOSC)
    write_vdb(tmp_path / "a.vdb", [spec])
    nano, vdb = read_volume(tmp_path / "a.nvdb"), read_volume(tmp_path / "a.vdb")
    assert_holds(nano, spec, "Float")
    assert_holds(vdb, spec, "Float")
    assert np.array_equal(nano.index_to_world, vdb.index_to_world)
    assert np.array_equal(nano.active_box, vdb.active_box)


@pytest.mark.parametrize("magic", [b"NanoVDB0", b"NanoVDB2"])
@pytest.mark.parametrize("version", [(32, 3, 3), (32, 4, 2), (32, 6, 0), (32, 9, 1)])
def test_versions_in_the_field(tmp_path, version, magic):
    spec = rich("Float")
    write_nvdb(tmp_path / "a.nvdb", [spec], "Float", ZIP, version, magic)
    assert_holds(read_nvdb(tmp_path / "a.nvdb"), spec, "Float")


@pytest.mark.parametrize("codec", [ZIP, BLOSC])
def test_grids_whose_size_leaves_out_that_of_the_chunk_as_warp_writes_them(tmp_path, codec):
    specs = [GridSpec(name, tiles=[((0, 0, 0), 8, value, True)]) for name, value in (("a", 1), ("b", 2))]
    write_nvdb(tmp_path / "a.nvdb", specs, codec=codec, uncounted=8)
    for name, value in (("a", 1), ("b", 2)):
        assert read_nvdb(tmp_path / "a.nvdb", name).tile_values.tolist() == [[value]]


@pytest.mark.parametrize("magic", [b"NanoVDB0", b"NanoVDB1"])
def test_bare_grids_one_after_the_other(tmp_path, magic):
    specs = [replace(rich("Float"), name="density"), replace(rich("Float"), name="heat", background=3)]
    grids = [bytearray(grid_bytes(spec, "Float", version_number(32, 6, 0), magic)) for spec in specs]
    for grid in grids:
        grid[664:672] = b"NanoVDB1"  # says that it is a grid, and no file
    (tmp_path / "a.nvdb").write_bytes(b"".join(grids))
    assert [info.name for info in list_nvdb(tmp_path / "a.nvdb")] == ["density", "heat"]
    assert_holds(read_nvdb(tmp_path / "a.nvdb", "heat"), specs[1], "Float")


@pytest.mark.parametrize("codec", [NONE, ZIP, BLOSC])
def test_grids_of_one_handle_are_all_found_where_they_are_packed_together(tmp_path, codec):
    """As NanoVDB 32.4 and before wrote a handle of several: a segment with one grid, which holds all."""
    specs = [replace(rich("Float"), name=name, background=10 + n) for n, name in enumerate("abb")]
    grids = [bytearray(grid_bytes(spec, "Float")) for spec in specs]
    for number, grid in enumerate(grids):
        struct.pack_into("<2I", grid, 24, number, len(grids))
    whole, path = b"".join(grids), tmp_path / "a.nvdb"
    written = write_nvdb(path, specs[:1], codec=codec)
    head = bytearray(written[: written.index(b"a\0") + 2])
    struct.pack_into("<2Q", head, 16, len(whole), len(packed(whole, codec)))
    for data in (bytes(head) + packed(whole, codec), whole):
        path.write_bytes(data)
        assert [info.name for info in list_nvdb(path)] == ["a", "b", "b[1]"]
        for number, spec in enumerate(specs):
            assert_holds(read_nvdb(path, number), spec, "Float")
    struct.pack_into("<Q", grids[1], 32, len(whole))
    damaged = packed(b"".join(grids), codec)
    struct.pack_into("<Q", head, 24, len(damaged))
    path.write_bytes(bytes(head) + damaged)
    with pytest.raises(VolumeError, match="grid 1 of 3 that are packed together is none"):
        list_nvdb(path)
    struct.pack_into("<I", grids[0], 28, 1 << 20)
    damaged = packed(b"".join(grids), codec)
    struct.pack_into("<Q", head, 24, len(damaged))
    path.write_bytes(bytes(head) + damaged)
    with pytest.raises(VolumeError, match="says that 1048576 grids are packed together"):
        list_nvdb(path)


def test_grids_are_found_by_name_and_number_in_all_segments(tmp_path, caplog):
    def grid(name, value):
        return GridSpec(name=name, tiles=[((0, 0, 0), 8, value, True)])

    first = write_nvdb(tmp_path / "a.nvdb", [grid("density", 1), grid("", 2)], codec=ZIP)
    second = write_nvdb(tmp_path / "b.nvdb", [grid("density", 3), grid("Cd", (4, 5, 6))], ["Float", "Vec3f"])
    path = tmp_path / "c.nvdb"
    path.write_bytes(first + second)
    assert [listed.name for listed in list_grids(path)] == ["density", "", "density[1]", "Cd"]
    assert [listed.channels for listed in list_grids(path)] == [1, 1, 1, 3]
    for choice, value in {"density[0]": 1, "": 2, "density[1]": 3, 2: 3, 0: 1}.items():
        assert read_nvdb(path, choice).tile_values.tolist() == [[value]]
    assert not caplog.records
    assert read_nvdb(path).tile_values.tolist() == [[1]]
    assert "has 2 grids named 'density'; the first is taken" in caplog.text
    with pytest.raises(VolumeError, match="no grid 'smoke'; its grids are 'density', '', 'density"):
        read_nvdb(path, "smoke")


@pytest.mark.parametrize("kind", ["Mask", "Boolean", "OnIndex", "PointIndex", "Vec4f", "RGBA8"])
def test_types_without_a_use_say_why(tmp_path, kind):
    write_nvdb(tmp_path / "a.nvdb", [GridSpec(grid_type=kind)], kind)
    (listed,) = list_grids(tmp_path / "a.nvdb")
    assert listed.unreadable.startswith(f"its values are {kind}")
    assert describe_volume(str(tmp_path / "a.nvdb"))[0].startswith("density: cannot be rendered, its values")
    with pytest.raises(VolumeError, match=f"grid 'density': its values are {kind}"):
        read_nvdb(tmp_path / "a.nvdb")


def test_what_a_file_begins_with_says_what_it_is_whatever_its_name(tmp_path):
    spec = rich("Float")
    write_nvdb(tmp_path / "a.vdb", [spec])
    write_vdb(tmp_path / "a.nvdb", [rich_grid()])
    assert_holds(read_volume(tmp_path / "a.vdb"), spec, "Float")
    assert_holds(read_volume(tmp_path / "a.nvdb"), rich_grid(), "Float")


def test_an_empty_grid_has_nothing_active(tmp_path):
    write_nvdb(tmp_path / "a.nvdb", [GridSpec()])
    read = read_nvdb(tmp_path / "a.nvdb")
    assert (read.active_voxels, len(read.leaf_values), list_nvdb(tmp_path / "a.nvdb")[0].active_box) == (
        0,
        0,
        None,
    )
    assert "no active voxels" in describe_volume(str(tmp_path / "a.nvdb"))[0]


@pytest.mark.skipif(
    not os.environ.get("CLVOL_DATA"), reason="CLVOL_DATA does not name the folder of test data"
)
def test_the_converted_cloud_is_the_cloud_voxel_by_voxel():
    folder = Path(os.environ["CLVOL_DATA"])
    nano = read_nvdb(folder / "wdas_cloud_sixteenth_zip.nvdb")
    vdb = read_vdb(folder / "wdas_cloud_sixteenth.vdb")

    def parts(grid):
        leaves = zip(grid.leaf_origins.tolist(), grid.leaf_values, grid.leaf_active, strict=True)
        tiles = zip(
            grid.tile_origins.tolist(), grid.tile_sizes, grid.tile_values, grid.tile_active, strict=True
        )
        return (
            {tuple(origin): (values.tobytes(), active.tobytes()) for origin, values, active in leaves},
            {tuple(origin): (edge, values.tobytes(), on) for origin, edge, values, on in tiles},
        )

    assert parts(nano) == parts(vdb)
    assert np.allclose(nano.index_to_world, vdb.index_to_world, rtol=1e-15, atol=0)
    assert (nano.background, nano.active_box.tolist()) == (vdb.background, vdb.active_box.tolist())
