"""`clvol info` says what a file holds, the unusual too, and never what is not so."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from places import CASES, SCENES
from vdb_writer import GridSpec, write_vdb

import clvol
from clvol.cli.main import main
from clvol.errors import printable
from clvol.scene.describe import active_statistics, describe_volume
from clvol.volumes import read_vdb

FILES = CASES / "vdb"


def info(*arguments) -> str:
    outcome = CliRunner().invoke(main, ["info", *map(str, arguments)])
    assert outcome.exit_code == 0, outcome.output
    return outcome.output


def refused(*arguments) -> str:
    """What is said, in one line, about arguments that do not fit."""
    outcome = CliRunner().invoke(main, [*map(str, arguments)])
    assert outcome.exit_code == 2
    (line,) = outcome.output.splitlines()
    return line


def test_nan_voxels_are_counted_and_the_rest_described():
    said = info(FILES / "nan.vdb")
    assert "values   0.1 to 1.098597, background 0; 1 NaN of 756\n" in said
    assert "sum      456.0298 of the others" in said


def test_a_dense_grid_of_nan_and_infinity_is_described(tmp_path):
    values = np.ones((2, 3, 4), np.float32)
    values[0, 0, :3] = np.nan, np.inf, -np.inf
    np.save(tmp_path / "a.npy", values)
    assert "values   1 to 1; 1 NaN and 2 infinite of 24\n" in info(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.full((1, 1, 2), np.nan))
    assert "values   none finite; 2 NaN of 2\n" in info(tmp_path / "a.npy")


def test_a_tile_counts_with_all_its_samples(tmp_path):
    leaf = {(0, 0, 0): (np.full((8, 8, 8), 2.0), np.ones((8, 8, 8), bool))}
    tiles = [((8, 0, 0), 8, np.nan, True), ((128, 0, 0), 128, 3, True), ((16, 0, 0), 8, np.inf, False)]
    write_vdb(tmp_path / "a.vdb", [GridSpec(leaves=leaf, tiles=tiles)])
    found = active_statistics(read_vdb(tmp_path / "a.vdb"))
    assert (found.low, found.high, found.total) == (2, 3, 2 * 512 + 3 * 128**3)
    assert (found.count, found.nan, found.infinite) == (2 * 512 + 128**3, 512, 0)


def test_an_empty_grid_says_that_it_has_no_active_voxels():
    said = info(FILES / "empty.vdb")
    assert said.startswith("density: sparse, no active voxels, background 0: there is nothing to render\n")
    assert "nan" not in said.lower()
    assert "stored   float" in said


def test_rendering_an_empty_grid_is_rendering_nothing(caplog):
    scene = {
        "type": "scene",
        "camera": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
    }
    smoke = {
        "type": "heterogeneous",
        "sigma_t": {"type": "vdbvolume", "filename": str(FILES / "empty.vdb")},
    }
    cube = {
        "type": "cube",
        "to_world": clvol.translate([0, 0, 4]),
        "bsdf": {"type": "null"},
        "interior": smoke,
    }
    loaded = clvol.load_dict(scene | {"sky": {"type": "constant"}, "cube": cube})
    assert "has no active voxels, and is 0 everywhere" in caplog.text
    assert (clvol.render(loaded, spp=2).image == 1).all()


def test_a_file_without_grids_says_so():
    assert "it has no grids" in info(FILES / "no_grids.vdb")
    assert "it has no grids" in refused("info", FILES / "no_grids.vdb", "--grid", "density")


def test_grids_that_cannot_be_rendered_say_why(tmp_path):
    said = info(FILES / "bool.vdb")
    assert said.startswith("density: cannot be rendered, its values are bool, which say where")
    frustum = ("NonlinearFrustumMap", [1.0] * 30)
    grids = [GridSpec(name="v", grid_type="Tree_vec3i_5_4_3"), GridSpec(name="f", transform=frustum)]
    write_vdb(tmp_path / "a.vdb", grids)
    said = info(tmp_path / "a.vdb")
    assert "v: cannot be rendered, its values are vec3i: those of float," in said
    assert "f: cannot be rendered, its transform is a NonlinearFrustumMap: affine ones" in said


def test_grids_of_one_name_have_their_own_facts():
    said = info(FILES / "same_name.vdb")
    first, second = said.split("density[1]: sparse")
    assert first.startswith("density: sparse")
    assert ("(-5, 3, -20) to (6, 11, -14) (index)" in first, "sum      445.3056" in first) == (True, True)
    assert "(10, 3, -20) to (21, 11, -14) (index)" in second
    assert "sum      890.6112" in second
    assert "445.3056" not in second
    assert info(FILES / "same_name.vdb", "--grid", "density[1]").splitlines()[1:] == second.splitlines()[1:-1]


def test_an_instance_names_the_grid_whose_tree_it_shares():
    said = info(FILES / "instances.vdb")
    temperature = said[said.index("temperature:") :]
    assert "(-10, 6, -40) to (12, 22, -28) (world)" in temperature
    assert "shared   its tree is that of density" in temperature
    assert said.count("shared") == 1


@pytest.mark.parametrize("content", [b"NanoVDB0" + bytes(100), b"", b"0BDVonaN" + bytes(100)])
def test_a_damaged_nanovdb_says_so(tmp_path, content):
    (tmp_path / "a.nvdb").write_bytes(content)
    said = refused("info", tmp_path / "a.nvdb")
    assert any(what in said for what in ("version 0.0 is not", "the file is empty", "big-endian order"))


HOSTILE = "smoke\x1b[2J\x07\r\n\u202edetrever\x9b31m"


def test_control_characters_of_names_are_shown_and_not_obeyed(tmp_path):
    tile = ((0, 0, 0), 8, 1, True)
    write_vdb(
        tmp_path / "a.vdb", [GridSpec(name=HOSTILE, tiles=[tile]), GridSpec(name=HOSTILE, grid_type=HOSTILE)]
    )
    np.savez(tmp_path / "a.npz", **{HOSTILE: np.ones((2, 2, 2))})
    (tmp_path / "a.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective"/><shape type="cube" id="a&#10;b&#x202e;c"/>'
        "</scene>"
    )
    for name in ("a.vdb", "a.npz", "a.xml"):
        said = info(tmp_path / name)
        assert all(line.isprintable() for line in said.splitlines()), name
    assert r"smoke\x1b[2J\x07\r\n\u202edetrever\x9b31m: dense" in info(tmp_path / "a.npz")
    assert len(info(tmp_path / "a.npz").splitlines()) == 5


def test_errors_do_not_obey_them_either(tmp_path):
    said = refused("info", tmp_path / "a\x1b[31m.vdb")
    assert said.isprintable()
    assert r"a\x1b[31m.vdb" in said


def test_printable_keeps_words_of_any_language():
    assert printable("Wölkchen 雲 é") == "Wölkchen 雲 é"


def test_options_that_do_not_fit_the_file_are_refused():
    assert "--grid chooses from a volume file" in refused("info", SCENES / "fire.xml", "--grid", "density")
    for name in ("fire.vdb", "cloud.vol"):
        assert "-D fills a scene's $NAMES" in refused("info", SCENES / name, "-D", "res=3")
    assert "no grid named 'density'" in refused("info", SCENES / "cloud.vol", "--grid", "density")


def test_describe_volume_reads_each_grid_once_by_its_place():
    lines = describe_volume(str(FILES / "same_name.vdb"))
    assert sum(line.startswith("density") for line in lines) == 2


def test_every_array_of_a_file_is_described(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, smoke=np.ones((2, 3, 4)), heat=np.full((2, 3, 4), 7.0), mask=np.ones((2, 2)))
    lines = describe_volume(str(path))
    assert [line.split(":")[0] for line in lines if not line.startswith(" ")] == ["smoke", "heat", "mask"]
    assert "mask: cannot be rendered, an array of 2 axes" in lines[-1]
    assert describe_volume(str(path), "heat")[0].startswith("heat: dense, 4 x 3 x 2")
