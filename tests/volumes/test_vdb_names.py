"""Grids that share a name or a tree, in files that OpenVDB wrote: each is found, and has its own facts.

The files of cases/vdb are OpenVDB's; the figures are those of its own tools.
"""

from __future__ import annotations

import logging
import re

import numpy as np
import pytest
from nvdb_writer import write_nvdb
from places import CASES
from vdb_writer import GridSpec, write_vdb

import clvol
from clvol.errors import VolumeError
from clvol.volumes import list_vdb, read_vdb, read_volume

FILES = CASES / "vdb"
SAME_NAME, INSTANCES = FILES / "same_name.vdb", FILES / "instances.vdb"
BOXES = {"density": [[-5, 3, -20], [6, 11, -14]], "density[1]": [[10, 3, -20], [21, 11, -14]]}
SUMS = {"density": 445.31, "density[1]": 890.61}


def warnings_of(caplog) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]


@pytest.mark.parametrize("name", BOXES)
def test_grids_of_one_name_are_both_reached_as_openvdb_calls_them(name):
    read = read_vdb(SAME_NAME, name)
    assert (read.name, read.active_box.tolist(), read.active_voxels) == (name, BOXES[name], 756)
    assert read.leaf_values.sum(dtype=np.float64) == pytest.approx(SUMS[name], abs=5e-3)
    assert read_volume(SAME_NAME, name).active_box.tolist() == BOXES[name]


def test_the_plain_name_of_several_grids_is_the_first_and_is_warned_of(caplog):
    read_vdb(SAME_NAME)
    (warning,) = warnings_of(caplog)
    assert "has 2 grids named 'density'; the first is taken, choose by density[0], density[1]" in warning
    assert str(SAME_NAME) in warning


@pytest.mark.parametrize("choice", ["density[0]", "density[1]", "density\x1e1", 0, 1])
def test_a_grid_that_is_chosen_is_not_warned_of(caplog, choice):
    read_vdb(SAME_NAME, choice)
    assert not warnings_of(caplog)


def test_a_scene_takes_the_grid_it_names(caplog):
    boxes = {}
    for name in ("density[0]", "density[1]"):
        volume = {"type": "vdbvolume", "filename": str(SAME_NAME), "grid": name}
        medium = {"type": "heterogeneous", "sigma_t": volume}
        scene = {
            "type": "scene",
            "camera": {"type": "perspective"},
            "b": {"type": "cube", "bsdf": {"type": "null"}, "interior": medium},
        }
        boxes[name] = clvol.load_dict(scene).shapes[0].interior.sigma_t.grid.active_box.tolist()
    assert list(boxes.values()) == list(BOXES.values())
    assert not warnings_of(caplog)


@pytest.mark.parametrize("plugin", ["vdbvolume", "gridvolume"])
def test_a_grid_without_a_name_is_named_by_nothing(tmp_path, plugin):
    names = ("density", "\x1e0")
    tiles = [((0, 0, 0), 8, 1, True)]
    write_vdb(tmp_path / "a.vdb", [GridSpec(name=n, tiles=tiles, background=len(n)) for n in names])
    volume = {"type": plugin, "filename": str(tmp_path / "a.vdb"), "grid": ""}
    medium = {"type": "heterogeneous", "sigma_t": volume}
    cube = {"type": "cube", "bsdf": {"type": "null"}, "interior": medium}
    scene = clvol.load_dict({"type": "scene", "camera": {"type": "perspective"}, "b": cube})
    assert scene.shapes[0].interior.sigma_t.grid.background == 2


def test_a_name_with_a_number_that_the_file_lacks_is_an_error_that_lists_the_names():
    for choice in ("density[2]", "density[", 2):
        with pytest.raises(VolumeError, match=r"has no grid .*its grids are 'density', 'density\[1\]'"):
            read_vdb(SAME_NAME, choice)


def test_names_that_a_careless_writer_repeats_are_numbered(tmp_path, caplog):
    grids = [GridSpec(tiles=[((0, 0, 0), 8, value, True)]) for value in (1, 2, 3)]
    write_vdb(tmp_path / "a.vdb", grids)
    assert [info.name for info in list_vdb(tmp_path / "a.vdb")] == ["density", "density[1]", "density[2]"]
    assert read_vdb(tmp_path / "a.vdb", "density[2]").tile_values == [3]
    assert read_vdb(tmp_path / "a.vdb").tile_values == [1]
    assert "has 3 grids" in warnings_of(caplog)[0]


def test_a_name_that_ends_like_a_number_is_a_name(tmp_path):
    names = {"a": 1, "a\x1e1": 2, "a[1]": 3, "b[0]": 4, "b": 5}
    grids = [GridSpec(name=name, tiles=[((0, 0, 0), 8, value, True)]) for name, value in names.items()]
    write_vdb(tmp_path / "a.vdb", grids)
    for name, value in names.items():
        assert read_vdb(tmp_path / "a.vdb", name).tile_values == [value]


def test_grids_before_the_place_where_a_file_is_cut_are_found(tmp_path):
    grids = [GridSpec(name=name, tiles=[((0, 0, 0), 8, 1, True)]) for name in ("a", "b", "c")]
    data = write_vdb(tmp_path / "a.vdb", grids)
    (tmp_path / "a.vdb").write_bytes(data[: data.index(b"\x01\x00\x00\x00c") + 3])
    assert read_vdb(tmp_path / "a.vdb", "b").tile_values == [1]
    for name in ("c", "d"):
        with pytest.raises(VolumeError, match=r"bytes are needed"):
            read_vdb(tmp_path / "a.vdb", name)


@pytest.mark.parametrize(
    ("name", "edge", "largest"),
    [("density", 1, 1.0985966), ("heat", 1, 2.1971931), ("temperature", 2, 1.0985966)],
)
def test_an_instance_has_its_parents_tree_under_its_own_transform(name, edge, largest):
    read = read_vdb(INSTANCES, name)
    assert (read.name, read.active_voxels) == (name, 756)
    assert np.array_equal(read.index_to_world, np.diag([edge, edge, edge, 1]))
    assert read.leaf_values.max() == pytest.approx(largest, abs=1e-6)


def test_a_file_with_instances_is_listed():
    grids = {info.name: info.parent for info in list_vdb(INSTANCES)}
    assert grids == {"density": "", "heat": "", "temperature": "density"}


def test_a_grid_with_a_tree_of_its_own_needs_a_sound_offset_of_it(tmp_path):
    path = tmp_path / "a.vdb"
    path.write_bytes(INSTANCES.read_bytes())
    data = bytearray(path.read_bytes())
    entry = data.index(b"Tree_float_5_4_3") + len("Tree_float_5_4_3") + 4
    assert data[entry - 4 : entry] == bytes(4), "no parent"
    data[entry + 8 : entry + 16] = bytes(8)
    path.write_bytes(data)
    with pytest.raises(VolumeError, match=re.escape("grid 'density' has offsets")):
        read_vdb(path)


@pytest.mark.parametrize("write", [write_vdb, write_nvdb])
def test_without_a_name_the_only_grid_is_meant_whatever_it_is_called(tmp_path, write):
    grids = [GridSpec(name, tiles=[((0, 0, 0), 8, 2, True)]) for name in ("smoke", "heat")]
    write(tmp_path / "a.vdb", grids[:1])
    write(tmp_path / "b.vdb", grids)
    assert read_volume(tmp_path / "a.vdb").name == "smoke"
    with pytest.raises(VolumeError, match="has no grid 'density'; its grids are 'smoke', 'heat'"):
        read_volume(tmp_path / "b.vdb")


def test_a_grid_that_is_named_here_and_not_there_is_read_once(tmp_path):
    write_vdb(tmp_path / "a.vdb", [GridSpec(tiles=[((0, 0, 0), 8, 0.5, True)])])
    plain = {"type": "vdbvolume", "filename": str(tmp_path / "a.vdb")}
    for first, second in ((plain, plain | {"grid": "density"}), (plain | {"grid": "density"}, plain)):
        medium = {"type": "heterogeneous", "sigma_t": first, "albedo": second}
        box = {"type": "cube", "bsdf": {"type": "null"}, "interior": medium}
        interior = (
            clvol.load_dict({"type": "scene", "s": {"type": "perspective"}, "b": box}).shapes[0].interior
        )
        assert interior.sigma_t.grid is interior.albedo.grid
