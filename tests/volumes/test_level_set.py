"""Level sets are said to be such, and become the fog volumes that OpenVDB makes of them.

level_set.nvdb is a sphere by OpenVDB's vdb_tool, and fog.nvdb what its `-ls2fog` (sdfToFogVolume) made.
"""

from __future__ import annotations

import numpy as np
import pytest
from nvdb_writer import write_nvdb
from places import CASES
from vdb_writer import GridSpec, write_vdb

import clvol
from clvol.errors import OptionError, SceneError, VolumeError
from clvol.scene.describe import describe_volume
from clvol.volumes import check_coefficients, check_finite, dense_from_array, list_grids, read_volume
from clvol.volumes.level_set import fog_of

FILES = CASES / "nvdb"
CLASS = [("class", "string", b"level set")]


def medium(**volume):
    """The medium of a scene whose extinction is this volume."""
    interior = {"type": "heterogeneous", "sigma_t": {"type": "vdbvolume", **volume}}
    scene = {
        "type": "scene",
        "camera": {"type": "perspective"},
        "b": {"type": "cube", "bsdf": {"type": "null"}, "interior": interior},
    }
    return clvol.load_dict(scene).shapes[0].interior


def test_fog_is_what_openvdb_makes_of_a_level_set():
    fog = clvol.load_volume(FILES / "level_set.nvdb", "sphere", level_set="fog")
    known = read_volume(FILES / "fog.nvdb", list_grids(FILES / "fog.nvdb")[0].name)
    assert known.kind == fog.kind == "fog volume"
    by_place = [np.lexsort(grid.leaf_origins.T) for grid in (fog, known)]
    for name in ("leaf_origins", "leaf_values", "leaf_active"):
        assert np.array_equal(getattr(fog, name)[by_place[0]], getattr(known, name)[by_place[1]]), name
    assert sorted(fog.tile_origins.tolist()) == sorted(known.tile_origins.tolist())
    for name in ("tile_values", "tile_active", "tile_sizes", "background", "active_box"):
        assert np.array_equal(getattr(fog, name), getattr(known, name)), name
    assert len(fog.tile_values) >= 1 and fog.leaf_values.max() <= 1


def band(background: float = 3.0) -> GridSpec:
    """A plane at x = 4 in leaves; inside, below it, voxels hold -x or so, and a tile lies deeper."""
    x = np.arange(8.0).reshape(8, 1, 1) - 4
    values = np.clip(np.broadcast_to(x, (8, 8, 8)), -background, background)
    outside = (np.full((8, 8, 8), background), np.ones((8, 8, 8), bool))
    tile = ((-8, 0, 0), 8, -background, False)
    leaves = {(0, 0, 0): (values, np.abs(values) < background), (8, 0, 0): outside}
    return GridSpec(background=background, leaves=leaves, tiles=[tile], metadata=CLASS)


def test_distances_become_a_ramp_from_the_surface_to_the_inner_tiles(tmp_path):
    write_vdb(tmp_path / "a.vdb", [band()])
    fog = clvol.load_volume(tmp_path / "a.vdb", level_set="fog")
    assert fog.leaf_origins.tolist() == [[0, 0, 0]]
    expected = np.float32([1, 1, 2 / 3, 1 / 3, 0, 0, 0, 0])
    assert np.allclose(fog.leaf_values[0, 5, 2, :, 0], expected, rtol=1e-6, atol=0)
    assert not np.signbit(fog.leaf_values).any()
    assert (fog.tile_values.tolist(), fog.tile_active.tolist(), fog.background.tolist()) == (
        [[1]],
        [True],
        [0],
    )
    assert (fog.active_box.tolist(), fog.active_voxels) == ([[-8, 0, 0], [3, 7, 7]], 512 + 4 * 64)
    check_coefficients(fog)


def test_without_inner_tiles_the_deepest_voxel_is_1(tmp_path):
    spec = band()
    spec.tiles = []
    write_vdb(tmp_path / "a.vdb", [spec])
    fog = clvol.load_volume(tmp_path / "a.vdb", level_set="fog")
    assert fog.leaf_values.max() == 1 and fog.active_voxels == 4 * 64


def test_a_level_set_of_nothing_is_an_empty_fog(tmp_path):
    write_vdb(tmp_path / "a.vdb", [GridSpec(background=3, metadata=CLASS)])
    fog = clvol.load_volume(tmp_path / "a.vdb", level_set="fog")
    assert (fog.active_voxels, fog.clear_outside) == (0, True)


@pytest.mark.parametrize("write", [write_vdb, write_nvdb])
def test_a_level_set_is_no_density_unless_it_is_made_fog(tmp_path, write):
    path = tmp_path / "a.vdb"
    write(path, [band()])
    assert list_grids(path)[0].kind == "level set"
    assert describe_volume(str(path))[-1].endswith(", level set")
    for check in (check_coefficients, check_finite):
        with pytest.raises(VolumeError, match=r'is a level set: distances .* it: level_set="fog"'):
            check(read_volume(path), "density")
    with pytest.raises(VolumeError, match="sigma_t of medium 'heterogeneous' is a level set"):
        medium(filename=str(path))
    fog = medium(filename=str(path), level_set="fog").sigma_t.grid
    assert fog.leaf_values.max() == 1


def test_a_file_may_not_say_that_it_is_a_level_set(tmp_path):
    spec = band()
    spec.metadata = []
    write_vdb(tmp_path / "a.vdb", [spec])
    assert clvol.load_volume(tmp_path / "a.vdb", level_set="fog").leaf_values.max() == 1


def test_distances_that_are_not_finite_are_counted(tmp_path):
    spec = band()
    spec.leaves[0, 0, 0][0][0, 0, :2] = np.nan, -np.inf
    write_vdb(tmp_path / "a.vdb", [spec])
    with pytest.raises(VolumeError, match="2 NaN or infinite of"):
        medium(filename=str(tmp_path / "a.vdb"), level_set="fog")
    spec.leaves = {(0, 0, 0): (np.full((8, 8, 8), np.nan), np.ones((8, 8, 8), bool))}
    spec.tiles = []
    write_vdb(tmp_path / "a.vdb", [spec])
    with pytest.raises(VolumeError, match="512 NaN or infinite of"):
        medium(filename=str(tmp_path / "a.vdb"), level_set="fog")


def test_what_is_no_level_set_is_refused(tmp_path):
    spec = band()
    spec.metadata = [("class", "string", b"fog volume")]
    write_vdb(tmp_path / "a.vdb", [spec])
    with pytest.raises(VolumeError, match="is a fog volume, not a level set"):
        clvol.load_volume(tmp_path / "a.vdb", level_set="fog")
    with pytest.raises(VolumeError, match="is no level set"):
        fog_of(dense_from_array(np.zeros((2, 2, 2))))
    with pytest.raises(SceneError, match="an array is no level set"):
        clvol.load_dict({"type": "scene", "m": {"type": "gridvolume", "data": 1, "level_set": "fog"}})
    with pytest.raises(OptionError, match="level_set cannot be 'smoke'"):
        clvol.load_volume(tmp_path / "a.vdb", level_set="smoke")
    with pytest.raises(SceneError, match=r"level_set.* cannot be 'smoke'"):
        medium(filename=str(tmp_path / "a.vdb"), level_set="smoke")
