"""Parameters of a sunsky: its lights are made anew, as if the scene was loaded with the values."""

import numpy as np
import pytest

import clvol
from clvol.scene.digest import scene_digest
from clvol.scene.lights import ConstantEmitter, EnvmapEmitter, SunEmitter

LOW = [1.0, 0.2, 0.3]
TURN = clvol.rotate((1, 0, 0), 90)


def scene_of(**given):
    film = {"type": "hdrfilm", "width": 6, "height": 4}
    camera = {"type": "perspective", "to_world": clvol.look_at((0, 0, 4), (0, 0, 0), (0, 1, 0)), "film": film}
    ball = {"type": "sphere"}
    sky = {"type": "sunsky", "turbidity": 4.0, **given}
    return clvol.load_dict(
        {"type": "scene", "camera": camera, "ball": ball, "sky": sky, "lamp": {"type": "point"}}
    )


def same(one, other):
    return scene_digest(one) == scene_digest(other) and [e.name for e in one.emitters] == [
        e.name for e in other.emitters
    ]


CASES = [
    ({}, "turbidity", 7.0, {"turbidity": 7.0}),
    ({}, "sky_scale", 0.3, {"sky_scale": 0.3}),
    ({}, "sky_scale", 0.0, {"sky_scale": 0.0}),
    ({}, "sun_scale", 0.0, {"sun_scale": 0.0}),
    ({}, "sun_aperture", 3.0, {"sun_aperture": 3.0}),
    ({}, "albedo", (0.1, 0.5, 0.9), {"albedo": {"type": "rgb", "value": [0.1, 0.5, 0.9]}}),
    ({}, "sun_direction", LOW, {"sun_direction": LOW}),
    ({}, "to_world", TURN, {"to_world": TURN}),
    (
        {"sun_direction": LOW},
        "to_world",
        clvol.rotate((0, 0, 1), 40),
        {"to_world": clvol.rotate((0, 0, 1), 40)},
    ),
    ({"sun_direction": LOW}, "sun_direction", [0, 0, -1], {"sun_direction": [0, 0, -1]}),
]


@pytest.mark.parametrize(("given", "name", "value", "more"), CASES, ids=[f"{n} {v}" for _, n, v, _ in CASES])
def test_an_updated_scene_is_the_one_loaded_with_the_value(given, name, value, more):
    scene, before = scene_of(**given), scene_of(**given)
    parameters = clvol.traverse(scene)
    old = parameters[f"sky.{name}"]
    parameters[f"sky.{name}"] = value
    assert len(parameters.update()) == 1
    assert same(scene, scene_of(**given | more)) and not same(scene, before)
    if name != "sun_direction":  # which a time and place do not name
        parameters.update({f"sky.{name}": old})
        assert same(scene, before)


def test_names_are_mitsubas_and_stand_once():
    names = [name for name in clvol.traverse(scene_of()) if name.startswith("sky")]
    mitsubas = ("turbidity", "sky_scale", "sun_scale", "albedo.value", "sun_direction", "to_world")
    assert {f"sky.{name}" for name in mitsubas} == {*names} - {"sky.sun_aperture"}


def test_a_sun_that_sets_takes_its_light_along_and_comes_back():
    scene = scene_of()
    parameters = clvol.traverse(scene)
    kinds = [EnvmapEmitter, SunEmitter]
    assert [type(e) for e in scene.emitters[:2]] == kinds
    parameters.update({"sky.sun_direction": (0, 0.1, -1)})
    assert [type(e) for e in scene.emitters[:1]] == [ConstantEmitter] and len(scene.emitters) == 2
    parameters.update({"sky.sun_direction": (0, 0.1, 1)})
    assert [type(e) for e in scene.emitters[:2]] == kinds and scene.emitters[2].name == "lamp"


def test_two_values_at_once_make_it_anew_once_and_the_picture_is_as_loaded():
    scene = scene_of()
    parameters = clvol.traverse(scene)
    options = {"spp": 4, "seed": 1}
    clvol.render(scene, **options)
    parameters.update({"sky.turbidity": 2.0, "sky.to_world": TURN, "lamp.intensity": 3.0})
    wanted = scene_of(turbidity=2.0, to_world=TURN)
    clvol.traverse(wanted).update({"lamp.intensity": 3.0})
    assert same(scene, wanted)
    assert np.array_equal(clvol.render(scene, **options).image, clvol.render(wanted, **options).image)


def test_what_is_too_bright_changes_nothing():
    scene, before = scene_of(), scene_of()
    parameters = clvol.traverse(scene)
    with pytest.raises(clvol.SceneError, match="must not exceed"):
        parameters.update({"sky.sky_scale": 1e30})
    assert same(scene, before)
    for name, value in (("turbidity", 0.5), ("albedo", 1.5), ("sun_direction", (0, 0, 0)), ("sun_scale", -1)):
        with pytest.raises(clvol.SceneError, match="must be"):
            clvol.traverse(scene)[f"sky.{name}"] = value
