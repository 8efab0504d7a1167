"""`sanitize`: NaN and slightly negative samples become 0 and are counted; nothing else is touched."""

from __future__ import annotations

import numpy as np
import pytest
from nvdb_writer import write_nvdb
from places import CASES
from vdb_writer import GridSpec, write_vdb

import clvol
from clvol.errors import OptionError, VolumeError
from clvol.volumes import check_coefficients, dense_from_array, write_vol
from clvol.volumes.repair import sanitized

VIEW = clvol.look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
FAULTS = np.array([np.nan, np.nan, -1e-6, -0.19, 0.5, 2.0, 0.0, 1.0])


def faulty() -> np.ndarray:
    """An array [z, y, x] of 2 NaN, 2 slightly negative samples, and a greatest of 2."""
    values = np.full((8, 8, 8), 0.25)
    values[3, 4] = FAULTS
    return values


def mended() -> np.ndarray:
    return np.where(faulty() > 0, faulty(), 0).astype("f4")


def scene_of(volume, role="sigma_t", **more):
    interior = {"type": "heterogeneous", "sigma_t": 1.0, role: volume, **more}
    if role != "sigma_t":
        interior |= {"type": "homogeneous"}
    film = {"type": "hdrfilm", "width": 4, "height": 4}
    return clvol.load_dict(
        {
            "type": "scene",
            "camera": {
                "type": "perspective",
                "film": film,
                "to_world": clvol.look_at([0, 0, 5], [0] * 3, [0, 1, 0]),
            },
            "sky": {"type": "constant"},
            "box": {"type": "cube", "bsdf": {"type": "null"}, "interior": interior},
        }
    )


def files(folder):
    """The faulty samples in each format, and the plugin that reads them."""
    leaves = {(0, 0, 0): (faulty().transpose(2, 1, 0), np.ones((8, 8, 8), bool))}
    write_vdb(folder / "a.vdb", [GridSpec(leaves=leaves)])
    write_nvdb(folder / "a.nvdb", [GridSpec(leaves=leaves)])
    write_vol(folder / "a.vol", faulty(), np.array([[0, 0, 0], [1, 1, 1]]))
    np.save(folder / "a.npy", faulty())
    np.savez(folder / "a.npz", smoke=faulty())


@pytest.mark.parametrize("name", ["a.vdb", "a.nvdb", "a.vol", "a.npy", "a.npz"])
def test_every_format_can_be_sanitized(tmp_path, name, caplog):
    files(tmp_path)
    with pytest.raises(VolumeError, match=r"2 NaN or infinite and 2 neg.*take them as 0: sanitize=True$"):
        check_coefficients(clvol.load_volume(tmp_path / name))
    read = clvol.load_volume(tmp_path / name, sanitize=True)
    check_coefficients(read)
    values = read.leaf_values[0] if name.endswith("vdb") else read.values
    assert np.array_equal(values[..., 0], mended())
    assert f"{name}" in caplog.text
    assert "2 NaN and 2 slightly negative samples are taken as 0" in caplog.text
    volume = scene_of({"type": "gridvolume", "filename": str(tmp_path / name), "sanitize": True})
    assert volume.shapes[0].interior.sigma_t.repairs == "2 NaN and 2 slightly negative"


def test_arrays_can_be_sanitized_and_the_picture_says_so():
    array = faulty()
    with pytest.raises(VolumeError, match=r"or take them as 0: sanitize=True$"):
        scene_of({"type": "gridvolume", "data": array})
    picture = clvol.render(scene_of({"type": "gridvolume", "data": array, "sanitize": True}), spp=2, seed=1)
    assert picture.metadata["sanitized"] == "scene.box.interior.sigma_t.data: 2 NaN and 2 slightly negative"
    clean = clvol.render(scene_of({"type": "gridvolume", "data": mended(), "sanitize": True}), spp=2, seed=1)
    assert "sanitized" not in clean.metadata
    assert np.array_equal(picture.image, clean.image)
    assert picture.metadata["digest"] == clean.metadata["digest"]
    assert np.isnan(array).any()


def test_xml_says_it_as_a_boolean(tmp_path):
    np.save(tmp_path / "a.npy", faulty())
    text = (
        '<scene version="3.0.0"><sensor type="perspective"/><shape type="cube"><bsdf type="null"/>'
        '<medium name="interior" type="heterogeneous"><volume name="sigma_t" type="gridvolume">'
        '<string name="filename" value="a.npy"/><boolean name="sanitize" value="true"/>'
        "</volume></medium></shape></scene>"
    )
    (tmp_path / "a.xml").write_text(text)
    assert clvol.load_file(tmp_path / "a.xml").shapes[0].interior.sigma_t.repairs
    (tmp_path / "a.xml").write_text(text.replace("true", "false"))
    with pytest.raises(VolumeError, match=r'as 0: <boolean name="sanitize" value="true"/>$'):
        clvol.load_file(tmp_path / "a.xml")


def test_temperatures_keep_what_is_negative():
    volume = {"type": "gridvolume", "data": faulty(), "sanitize": True}
    temperature = scene_of(volume, "temperature").shapes[0].interior.temperature
    assert temperature.repairs == "2 NaN"
    assert temperature.grid.values.min() == np.float32(-0.19)


@pytest.mark.parametrize("fault", [-0.3, np.inf])
def test_what_is_more_than_slight_stays_an_error_without_advice_that_cannot_help(fault):
    values = faulty()
    values[0, 0, 0] = fault
    grid, repairs = sanitized(dense_from_array(values))
    assert (repairs.nan, repairs.negative) == (2, 2)
    with pytest.raises(VolumeError, match=r"repair or clamp the data$"):
        check_coefficients(grid)
    with pytest.raises(VolumeError, match=r"repair or clamp the data$"):
        check_coefficients(dense_from_array(values))


def test_what_is_whole_is_returned_as_it_is(caplog):
    grid = dense_from_array(mended())
    assert sanitized(grid)[0] is grid
    assert not caplog.records


def test_what_openvdb_wrote_with_nan_in_it_can_be_rendered():
    read = clvol.load_volume(CASES / "vdb" / "nan.vdb", sanitize=True)
    check_coefficients(read)


@pytest.mark.parametrize(
    ("given", "options", "told"),
    [
        (None, {}, "load_volume takes a file's name, not None"),
        (3, {}, "load_volume takes a file's name, not 3"),
        ("a.npy", {"sanitize": "yes"}, "sanitize='yes' is neither True nor False"),
    ],
)
def test_what_load_volume_cannot_take_is_told(given, options, told):
    with pytest.raises(OptionError, match=told):
        clvol.load_volume(given, **options)


def test_media_that_share_a_volume_still_do():
    volume = {"type": "gridvolume", "data": faulty(), "sanitize": True, "id": "smoke"}
    interior = {"type": "heterogeneous", "sigma_t": volume, "emission": {"type": "ref", "id": "smoke"}}
    scene = {
        "type": "scene",
        "camera": {"type": "perspective"},
        "box": {"type": "cube", "bsdf": {"type": "null"}, "interior": interior},
    }
    medium = clvol.load_dict(scene).shapes[0].interior
    assert medium.sigma_t is medium.emission


def test_a_volume_alone_can_be_sanitized(tmp_path, caplog):
    np.save(tmp_path / "a.npy", faulty())
    with pytest.raises(VolumeError, match="sanitize=True"):
        clvol.volume_scene(tmp_path / "a.npy")
    medium = clvol.volume_scene(tmp_path / "a.npy", sanitize=True).shapes[0].interior
    assert medium.sigma_t.repairs == "2 NaN and 2 slightly negative"
    assert caplog.text.count("are taken as 0") == 1
