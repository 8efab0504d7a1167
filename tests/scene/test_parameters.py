"""`clvol.traverse`: a scene's values by Mitsuba's names; what they may be, and what may not go together."""

from __future__ import annotations

import copy
import importlib
import os
import subprocess

import numpy as np
import pytest
from places import TOOLS

import clvol

VALUES = np.random.default_rng(2).random((4, 5, 6), np.float32)
PICTURE = np.ones((4, 5, 3), np.float32)
RGB = {"type": "rgb", "value": [0.1, 0.2, 0.3]}
NAMES = """
sensor.near_clip sensor.far_clip sensor.film.size sensor.film.crop_size sensor.film.crop_offset sensor.x_fov
sensor.principal_point_offset_x sensor.principal_point_offset_y sensor.to_world sky.radiance.value
pt.position pt.intensity.value spot.intensity.value spot.cutoff_angle spot.beam_width spot.to_world
smoke.interior_medium.scale smoke.interior_medium.albedo.value.value smoke.interior_medium.sigma_t.data
smoke.interior_medium.phase_function.g ball.to_world ball.interior_medium.scale
ball.interior_medium.albedo.value.value ball.interior_medium.sigma_t.value.value lamp.to_world
lamp.emitter.radiance.value lamp.bsdf.reflectance.value wall.to_world wall.bsdf.reflectance.value
slide.irradiance.value slide.scale slide.to_world pic.irradiance.data pic.scale pic.to_world
coat.bsdf.diffuse_reflectance.color0.value coat.bsdf.diffuse_reflectance.color1.value coat.bsdf.alpha
"""
"""Of the scene below, as ``mi.traverse`` of Mitsuba 3.9 has them."""
MITSUBAS = frozenset(NAMES.split())


def description():
    smoke = {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "grid": VALUES},
        "albedo": {"type": "constvolume", "value": {"type": "rgb", "value": [0.5, 0.6, 0.7]}},
        "phase": {"type": "hg", "g": 0.3},
    }
    fog = {"type": "homogeneous", "sigma_t": RGB, "albedo": 0.5}
    return {
        "type": "scene",
        "integrator": {"type": "volpath"},
        "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 6}},
        "sky": {"type": "constant"},
        "pt": {"type": "point"},
        "spot": {"type": "spot"},
        "slide": {"type": "projector", "fov": 40.0},
        "pic": {"type": "projector", "fov": 40.0, "irradiance": {"type": "bitmap", "bitmap": PICTURE}},
        "sun": {"type": "directional", "direction": [0, 0, 2]},
        "smoke": {"type": "cube", "bsdf": {"type": "null"}, "interior": smoke},
        "ball": {"type": "sphere", "bsdf": {"type": "null"}, "interior": fog},
        "lamp": {"type": "rectangle", "light": {"type": "area", "radiance": RGB}},
        "wall": {"type": "rectangle", "look": {"type": "diffuse", "reflectance": RGB}},
        "coat": {
            "type": "sphere",
            "look": {"type": "roughplastic", "diffuse_reflectance": {"type": "checkerboard"}},
        },
    }


@pytest.fixture
def scene():
    return clvol.load_dict(description())


def test_names_are_mitsubas(scene):
    assert set(clvol.traverse(scene)) >= MITSUBAS


@pytest.mark.mitsuba
def test_they_are_mitsubas_own_names():
    """In Mitsuba's process: what this scene's parameters are called there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(TOOLS)
        side = importlib.import_module("benchmarks.mitsuba_side")
    python = side.mitsuba_python(os.environ.get("CLVOL_MITSUBA"))
    code = (
        "import mitsuba as mi, numpy as np; mi.set_variant('scalar_rgb'); scene = eval(input());"
        "scene['smoke']['interior']['sigma_t']['grid'] = mi.VolumeGrid(np.ones((4, 5, 6), np.float32));"
        "scene['pic']['irradiance']['bitmap'] = mi.Bitmap(np.ones((4, 5, 3), np.float32));"
        "print(*mi.traverse(mi.load_dict(scene)).properties)"
    )
    given = description()
    given["smoke"]["interior"]["sigma_t"]["grid"] = None
    given["pic"]["irradiance"]["bitmap"] = None
    del given["sun"]["direction"]
    done = subprocess.run([python, "-c", code], input=repr(given), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) >= MITSUBAS


def test_names_of_scene_files_will_do_too(scene):
    parameters = clvol.traverse(scene)
    pairs = {
        "smoke.interior.scale": "smoke.interior_medium.scale",
        "smoke.interior.phase.g": "smoke.interior_medium.phase_function.g",
        "sky.radiance": "sky.radiance.value",
        "ball.interior.albedo": "ball.interior_medium.albedo.value.value",
    }
    for short, name in pairs.items():
        assert short in parameters and short not in list(parameters)
        assert parameters[short] == parameters[name]


def test_things_without_an_id_are_numbered():
    nameless = """<scene version="3.0.0"><sensor type="perspective" id="camera"/><shape type="sphere"/>
        <shape type="cube"/><emitter type="constant"/></scene>"""
    parameters = clvol.traverse(clvol.load_string(nameless))
    assert {"shape.to_world", "shape_1.to_world", "emitter.radiance.value"} <= set(parameters)
    assert parameters["sensor.x_fov"] == parameters["camera.x_fov"]


def fresh(changes):
    """The scene with other values, loaded anew."""
    given = description()
    for path, value in changes.items():
        *parts, last = path.split("/")
        place = given
        for part in parts:
            place = place[part]
        place[last] = value
    return clvol.load_dict(given)


EYE = clvol.look_at((0, 1, -5), (0, 0, 0), (0, 1, 0))
CHANGES = [
    ("sensor.to_world", EYE, "sensor/to_world", EYE),
    ("sensor.x_fov", 30, "sensor/fov", 30),
    ("sensor.film.size", (4, 3), "sensor/film", {"type": "hdrfilm", "width": 4, "height": 3}),
    ("sky.radiance.value", (1, 2, 3), "sky/radiance", {"type": "rgb", "value": [1, 2, 3]}),
    ("sun.direction", (0, 3, 4), "sun/direction", [0, 3, 4]),
    ("slide.irradiance.value", (1, 2, 3), "slide/irradiance", {"type": "rgb", "value": [1, 2, 3]}),
    ("pic.irradiance.data", 3 * PICTURE, "pic/irradiance", {"type": "bitmap", "bitmap": 3 * PICTURE}),
    ("pic.x_fov", 30, "pic/fov", 30),
    ("smoke.interior.scale", 7.5, "smoke/interior/scale", 7.5),
    ("smoke.interior.phase.g", -0.5, "smoke/interior/phase", {"type": "hg", "g": -0.5}),
    (
        "smoke.interior.sigma_t.data",
        VALUES[::2] + 1,
        "smoke/interior/sigma_t",
        {"type": "gridvolume", "grid": VALUES[::2] + 1},
    ),
    ("ball.interior.sigma_t", (3, 2, 1), "ball/interior/sigma_t", {"type": "rgb", "value": [3, 2, 1]}),
    ("ball.to_world", clvol.scale(2), "ball/to_world", clvol.scale(2)),
    ("lamp.emitter.radiance.value", 5.0, "lamp/light", {"type": "area", "radiance": 5.0}),
    ("wall.bsdf.reflectance", 0.25, "wall/look", {"type": "diffuse", "reflectance": 0.25}),
]


@pytest.mark.parametrize(("name", "value", "path", "given"), CHANGES, ids=[c[0] for c in CHANGES])
def test_an_updated_scene_is_the_one_loaded_with_the_value(scene, name, value, path, given):
    parameters = clvol.traverse(scene)
    before = parameters[name]
    parameters[name] = value
    changed = parameters.update()
    assert len(changed) == 1
    expected = clvol.traverse(fresh({path: given}))
    assert list(parameters) == list(expected)
    for key in parameters:
        np.testing.assert_allclose(parameters[key], expected[key], rtol=1e-12, err_msg=key)
    parameters.update({name: before})
    original = clvol.traverse(clvol.load_dict(description()))
    for key in set(original) - {"smoke.interior_medium.sigma_t.data"}:
        np.testing.assert_allclose(parameters[key], original[key], rtol=1e-12, err_msg=key)


def test_nothing_changes_before_the_update_nor_by_equal_values(scene):
    parameters = clvol.traverse(scene)
    shapes = scene.shapes
    parameters["smoke.interior.scale"] = 3
    assert parameters["smoke.interior.scale"] == 3
    assert scene.shapes is shapes
    parameters["smoke.interior.scale"] = 1.0
    assert parameters.update() == [] and scene.shapes is shapes


def test_shared_media_stay_shared():
    given = description()
    given["smoke"]["interior"]["id"] = "fog"
    given["twin"] = {"type": "cube", "bsdf": {"type": "null"}, "interior": {"type": "ref", "id": "fog"}}
    scene = clvol.load_dict(given)
    parameters = clvol.traverse(scene)
    parameters.update({"smoke.interior.scale": 2.0, "smoke.interior.phase.g": 0.1})
    media = {id(shape.interior) for shape in scene.shapes if shape.name in ("smoke", "twin")}
    assert len(media) == 1


def test_two_that_traverse_a_scene_see_each_other(scene):
    one, two = clvol.traverse(scene), clvol.traverse(scene)
    one.update({"sky.radiance.value": 0.1})
    assert two["sky.radiance.value"] == 0.1
    assert two.update({"sky.radiance.value": 0.2}) == ["sky.radiance.value"]
    assert one["sky.radiance.value"] == 0.2 and scene.emitters[0].radiance == (0.2,)
    with pytest.raises(clvol.OptionError, match="update takes a dict of values, not"):
        one.update(3)


def test_values_that_are_read_cannot_be_written_to(scene):
    parameters = clvol.traverse(scene)
    for name in ("sensor.to_world", "smoke.interior.sigma_t.data"):
        with pytest.raises(ValueError, match="read-only"):
            parameters[name][0] = 0


MISTAKES = [
    ("sensor.to_wold", np.eye(4), "no parameter 'sensor.to_wold'; did you mean 'sensor.to_world'"),
    (3, 1, "no parameter 3"),
    ("sensor.to_world", np.eye(3), "expected a transform"),
    ("sensor.to_world", np.diag([2, 2, 2, 1]), "must not scale or shear"),
    ("sensor.x_fov", 180, "must be a number that is in .0, 180., got 180"),
    ("sensor.x_fov", True, "must be a number"),
    ("sensor.film.size", (0, 4), "two whole numbers of at least 1"),
    ("sensor.film.size", 4, "two whole numbers"),
    ("sky.radiance.value", -1, "a number or a colour of three"),
    ("sky.radiance.value", "red", "a number or a colour of three"),
    ("smoke.interior.scale", float("nan"), "a number or a colour of three"),
    ("smoke.interior.albedo", 1.5, "in .0, 1."),
    ("smoke.interior.phase.g", 1, "in .-0.999997, 0.999997."),
    ("smoke.interior.sigma_t.data", -VALUES, "120 negative"),
    ("smoke.interior.sigma_t.data", VALUES[0], "array of 2 axes"),
    ("smoke.interior.sigma_t.data", np.ones((2, 2, 2, 3)), "must have 1 channel as before"),
    ("smoke.interior.sigma_t.data", "smoke.vdb", "an array of numbers"),
    ("coat.to_world", np.diag([1, 2, 1, 1]), "must not stretch or shear a sphere"),
    ("spot.to_world", np.diag([1, 2, 1, 1]), "must not stretch or shear"),
    ("pic.to_world", np.diag([1, 2, 1, 1]), "must not stretch or shear"),
    ("pic.irradiance.data", -PICTURE, "texels must be in"),
    ("slide.scale", -1, "must be a number that is in"),
    ("sun.direction", (0, 0, 0), "another length than 0"),
    ("pt.position", (0, 0), "three finite numbers"),
]


@pytest.mark.parametrize(("name", "value", "message"), MISTAKES, ids=range(len(MISTAKES)))
def test_what_a_parameter_cannot_be_is_said_at_once(scene, name, value, message):
    parameters = clvol.traverse(scene)
    with pytest.raises(clvol.Error, match=message):
        parameters[name] = value
    assert parameters.update() == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor.near_clip": 5.0, "sensor.far_clip": 4.0}, "must be beyond near_clip"),
        ({"sensor.film.crop_size": (9, 6)}, "reaches beyond the film"),
        ({"spot.beam_width": 30.0}, "must not exceed cutoff_angle"),
    ],
)
def test_what_does_not_go_together_changes_nothing(scene, changes, message):
    parameters = clvol.traverse(scene)
    before = copy.copy(scene.sensors), scene.shapes
    with pytest.raises(clvol.SceneError, match=message):
        parameters.update(changes)
    assert (scene.sensors, scene.shapes) == before
    both = {"sensor.near_clip": 2e4, "sensor.far_clip": 3e4}
    fine = clvol.traverse(clvol.load_dict(description()))
    assert len(fine.update(both)) == 2


def test_a_parameter_stays_in_the_scene(scene):
    parameters = clvol.traverse(scene)
    with pytest.raises(clvol.OptionError, match="cannot be taken out"):
        del parameters["sky.radiance.value"]
    with pytest.raises(KeyError):
        parameters["nothing"]
    assert parameters.get("nothing") is None and "nothing" not in parameters
    with pytest.raises(clvol.OptionError, match="traverse takes a Scene"):
        clvol.traverse(description())


def test_the_table_shows_every_value_in_a_line(scene):
    lines = repr(clvol.traverse(scene)).splitlines()
    assert any(line.split() == ["sensor.film.size", "(8,", "6)"] for line in lines)
    assert any("sigma_t.data" in line and "(4, 5, 6)" in line for line in lines)


def test_indices_of_metals_that_are_textures_have_no_bound():
    checkers = {"type": "checkerboard", "color0": 3.0}
    metal = {"type": "conductor", "eta": {"type": "bitmap", "bitmap": PICTURE}, "k": checkers}
    scene = clvol.load_dict(
        {"type": "scene", "sensor": {"type": "perspective"}, "m": {"type": "sphere", "bsdf": metal}}
    )
    parameters = clvol.traverse(scene)
    parameters.update({"m.bsdf.eta.data": 4 * PICTURE, "m.bsdf.k.color1": 5.0})
    [shape] = scene.shapes
    assert shape.bsdf.eta.pixels.max() == 4 and shape.bsdf.k.color1 == (5.0,)
    with pytest.raises(clvol.SceneError, match="texels must be in"):
        parameters["m.bsdf.eta.data"] = -PICTURE
