"""Masked arrays: what is masked has no value.

A volume is empty there; pictures, colours and transforms need every value.  Also values that rounding put a
little above their maximum.
"""

from __future__ import annotations

import logging

import numpy as np
import pytest

import clvol
from clvol.errors import Error, SceneError, VolumeError
from clvol.volumes import check_coefficients, dense_from_array, write_vol

RNG = np.random.default_rng(7)
HOLES = RNG.random((4, 5, 6)) < 0.3


def masked(values=None, shape=HOLES.shape, dtype=np.float64) -> np.ma.MaskedArray:
    """Samples whose masked places hold NaN, or what is as bad."""
    values = (10 * RNG.random(shape)).astype(dtype) if values is None else values
    mask = np.broadcast_to(HOLES.reshape(HOLES.shape + (1,) * (len(shape) - 3)), shape)
    values[mask] = np.nan if np.dtype(dtype).kind == "f" else -99
    return np.ma.array(values, mask=mask)


def warnings_of(caplog) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]


@pytest.mark.parametrize("dtype", ["f4", "f8", "i2"])
@pytest.mark.parametrize("shape", [HOLES.shape, (*HOLES.shape, 3)])
def test_a_volume_is_empty_where_it_is_masked(caplog, shape, dtype):
    array = masked(shape=shape, dtype=dtype)
    grid = dense_from_array(array, source="scene.xml:3")
    assert np.array_equal(grid.values.reshape(shape), array.filled(0).astype(np.float32))
    check_coefficients(grid)
    count = np.count_nonzero(array.mask)
    assert warnings_of(caplog) == [f"scene.xml:3: {count} of {array.size} samples are masked, and taken as 0"]


def test_an_array_without_masked_samples_is_taken_as_it_is(caplog):
    values = RNG.random((4, 5, 6))
    for array in (np.ma.array(values), np.ma.array(values, mask=np.zeros(values.shape, bool))):
        assert np.array_equal(dense_from_array(array).values[..., 0], values.astype(np.float32))
    assert not warnings_of(caplog)


def test_a_list_of_masked_slices_is_masked_too():
    array = masked()
    grid = dense_from_array(list(array))
    assert np.array_equal(grid.values[..., 0], array.filled(0).astype(np.float32))


def medium(**parameters):
    inside = {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "data": np.ones((4, 5, 6))},
    } | parameters
    cube = {"type": "cube", "bsdf": {"type": "null"}, "interior": inside}
    return clvol.load_dict({"type": "scene", "camera": {"type": "perspective"}, "b": cube}).shapes[0].interior


@pytest.mark.parametrize("name", ["sigma_t", "albedo", "emission", "temperature"])
@pytest.mark.parametrize("key", ["data", "grid"])
def test_every_volume_of_a_medium_takes_masked_arrays(caplog, name, key):
    array = masked(RNG.random(HOLES.shape))
    volume = getattr(medium(**{name: {"type": "gridvolume", key: array}}), name)
    assert np.array_equal(volume.grid.values[..., 0], array.filled(0).astype(np.float32))
    assert (
        f"{name}.{key}: {np.count_nonzero(HOLES)} of {HOLES.size} samples are masked"
        in warnings_of(caplog)[0]
    )


def scene_error(**items) -> str:
    with pytest.raises(SceneError) as caught:
        clvol.load_dict({"type": "scene", "camera": {"type": "perspective"}} | items)
    return str(caught.value)


def test_pictures_need_every_value():
    pixels = np.ma.array(np.full((4, 6, 3), 0.5), mask=np.zeros((4, 6, 3), bool))
    pixels[1, 2] = np.ma.masked
    wall = {"type": "bitmap", "bitmap": pixels}
    told = "3 of 72 values are masked, a picture needs them all; give them values: array.filled(0)"
    assert told in scene_error(sky={"type": "envmap", "bitmap": pixels})
    assert told in scene_error(w={"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": wall}})


def test_transforms_points_and_colours_need_every_value():
    matrix = np.ma.array(np.eye(4), mask=np.eye(4, k=1, dtype=bool))
    vector = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    assert "not finite" in scene_error(b={"type": "cube", "to_world": matrix})
    assert "position" in scene_error(p={"type": "point", "position": vector})
    assert "radiance" in scene_error(c={"type": "constant", "radiance": {"type": "rgb", "value": vector}})
    for make in (
        clvol.translate,
        clvol.scale,
        lambda v: clvol.rotate(v, 30),
        lambda v: clvol.look_at(v, [0] * 3, v),
    ):
        with pytest.raises(SceneError, match="three finite numbers"):
            make(vector)
    whole = np.ma.array([1.0, 2.0, 3.0])
    assert np.array_equal(clvol.translate(whole), clvol.translate([1, 2, 3]))


def test_a_vol_is_not_written_with_masked_samples(tmp_path):
    with pytest.raises(VolumeError, match=f"{np.count_nonzero(HOLES)} samples are masked"):
        write_vol(tmp_path / "a.vol", masked(), np.array([[0, 0, 0], [1, 1, 1]]))
    assert not (tmp_path / "a.vol").exists()


# Layout


@pytest.mark.parametrize(
    ("shape", "advice"),
    [((5, 8, 8, 8), "give one time of it, as array[0]"), ((3, 8, 8, 8), "numpy.moveaxis(array, 0, -1)")],
)
def test_four_axes_that_are_no_channels_are_told_by_their_shape(shape, advice):
    with pytest.raises(VolumeError) as caught:
        dense_from_array(np.ones(shape))
    assert f"an array of shape {shape}" in str(caught.value)
    assert "the last axis has 1 or 3 channels, not 8" in str(caught.value)
    assert advice in str(caught.value)


# Rounding


NEARLY = np.float32(1.0000001)


def nearly_one(kind: str):
    if kind == "grid":
        return {"type": "gridvolume", "data": np.array([[[0.5, NEARLY]]])}
    if kind == "constvolume":
        return {"type": "constvolume", "value": 1.0000001}
    if kind == "rgb":
        return {"type": "rgb", "value": [0.5, 1.0000001, 1.0]}
    return 1.0000001


@pytest.mark.parametrize("kind", ["grid", "constvolume", "rgb", "number"])
def test_an_albedo_a_rounding_above_one_is_one_with_a_warning(caplog, kind):
    albedo = medium(albedo=nearly_one(kind)).albedo
    assert np.max(albedo.grid.values if kind == "grid" else albedo.value) == 1
    (warning,) = warnings_of(caplog)
    assert "1.0000001" in warning
    assert "taken as 1" in warning


def test_the_samples_of_a_grid_that_is_cut_as_albedo_stay_as_they_are_elsewhere():
    shared = {"type": "gridvolume", "data": np.array([[[0.5, NEARLY]]])}
    found = medium(albedo=shared, sigma_t=shared)
    assert found.sigma_t.grid.values.max() == NEARLY
    assert found.albedo.grid.values.max() == 1


@pytest.mark.parametrize("value", [1.00001, 1.1])
def test_an_albedo_that_is_truly_above_one_is_refused_with_all_its_digits(value):
    with pytest.raises(Error, match=rf"at most 1, the volume reaches {value}"):
        medium(albedo={"type": "gridvolume", "data": np.full((2, 2, 2), value)})
    with pytest.raises(Error, match=rf"in \[0, 1\], got \[{value}\]"):
        medium(albedo=value)
