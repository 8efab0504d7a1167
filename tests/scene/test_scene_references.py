"""Ids, references and aliases; what stands in a scene and belongs to nothing; files and texts without end."""

import logging

import numpy as np
import pytest
from places import CASES

import clvol
from clvol.errors import LONGEST, SceneError
from clvol.scene import load_dict, load_file, translate, vocabulary
from clvol.scene.nodes import Node
from clvol.scene.records import Shape

SENSOR = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'
CUBE = '<shape type="cube"><ref id="b"/></shape>'
DIFFUSE = '<bsdf type="diffuse" id="a"/>'


@pytest.fixture
def load(tmp_path):
    def load_text(elements, **defaults):
        (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">\n{elements}\n{SENSOR}</scene>\n')
        return load_file(tmp_path / "scene.xml", **defaults)

    return load_text


def error_of(load, elements, **defaults):
    with pytest.raises(SceneError) as caught:
        load(elements, **defaults)
    return str(caught.value)


# -- area lights and aliases ---------------------------------------------------------------------------


def test_an_area_emitter_may_stand_in_the_scene_and_be_referred_to():
    scene = load_file(CASES / "lamp.xml")
    assert (scene.emitters, scene.shapes[0].emission) == ((), (3.0,))
    image = clvol.render(scene, spp=4).image
    np.testing.assert_allclose(image[3:5, 3:5], 3.0, rtol=1e-5)


def test_it_may_light_several_shapes_and_dicts_do_the_same(load):
    lamp = '<emitter type="area" id="l"/>' + '<shape type="sphere"><ref id="l"/></shape>' * 2
    assert [shape.emission for shape in load(lamp).shapes] == [(1.0,), (1.0,)]
    ref = {"type": "ref", "id": "lamp"}
    scene = {"type": "scene", "s": {"type": "perspective", "fov": 40}, "lamp": {"type": "area"}}
    assert load_dict(scene | {"ball": {"type": "sphere", "it": ref}}).shapes[0].emission == (1.0,)
    with pytest.raises(SceneError, match=r"scene\.lamp: an area emitter outside a shape lights nothing"):
        load_dict(scene | {"again": ref})


def test_an_alias_is_a_second_id(load):
    assert load_file(CASES / "alias.xml").shapes[0].bsdf.reflectance == (0.5,)
    chain = '<alias id="a" as="c"/><alias id="c" as="b"/>'
    assert load(DIFFUSE + chain + CUBE).shapes
    assert load('<default name="x" value="b"/><alias id="a" as="$x"/>' + DIFFUSE + CUBE).shapes
    assert load(f'{DIFFUSE}<shape type="cube"><alias id="a" as="b"/><ref id="b"/></shape>').shapes


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        ('<alias id="a" as="b"/>', "scene.xml:2: alias of an unknown id 'a'"),
        ('<alias id="b" as="b"/>', "alias of an unknown id 'b'"),
        (DIFFUSE + '\n<alias id="a" as="a"/>', "scene.xml:3: the id 'a' is given twice; first at"),
        (
            DIFFUSE + '<alias id="a" as="b"/>\n<alias id="a" as="b"/>',
            "scene.xml:3: the id 'b' is given twice",
        ),
        (DIFFUSE + '<alias id="a"/>', "<alias> needs the attribute 'as'"),
        (DIFFUSE + '<alias id="a" as="b" name="c"/>', "unknown attribute 'name' of <alias>"),
        (DIFFUSE + '<alias id="a" as="b"><float/></alias>', "<float> cannot be inside <alias>"),
    ],
)
def test_impossible_aliases_are_errors(load, elements, message):
    assert message in error_of(load, elements)


# -- what belongs to nothing ---------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["medium type='homogeneous'", "film type='hdrfilm'", "phase type='hg'"])
def test_a_part_without_an_id_that_stands_in_the_scene_is_an_error(load, element):
    assert "stands in the scene and belongs to nothing; put it into" in error_of(load, f"\n<{element}/>")


def test_a_part_with_an_id_that_nothing_refers_to_is_warned_of(load, caplog):
    with caplog.at_level(logging.WARNING, logger="clvol"):
        load(DIFFUSE + '<alias id="a" as="b"/>' + CUBE)
        assert not caplog.text
        load(DIFFUSE + "".join(f'<bsdf type="null" id="n{k}"/>' for k in range(9)))
    assert "defined in the scene and not used: 'a', 'n0', 'n1', 'n2', 'n3' and 5 more" in caplog.text


def test_a_part_with_a_name_alone_as_mitsuba_writes_those_of_dicts_is_warned_of(load, caplog):
    with caplog.at_level(logging.WARNING, logger="clvol"):
        load('<texture type="checkerboard" name="paint"/><shape type="cube"/>')
    assert "defined in the scene and not used: 'paint'" in caplog.text


def test_misnamed_volumes_are_not_said_to_be_unwelcome(load):
    volume = '<medium type="heterogeneous" id="m"><volume name="sigmat" type="constvolume"/></medium>'
    assert "unknown parameter 'sigmat' of medium 'heterogeneous'; did you mean 'sigma_t'?" in error_of(
        load, volume
    )


def test_a_light_that_is_never_sampled_is_an_error(load):
    light = '<emitter type="point"><float name="sampling_weight" value="0"/></emitter>'
    assert "sampling_weight is 0" in error_of(load, light)


@pytest.mark.parametrize(
    "light",
    [
        '<emitter type="constant"><float name="radiance" value="1e38"/></emitter>',
        '<emitter type="constant"><spectrum name="radiance" value="400:1e38 700:1e38"/></emitter>',
        '<emitter type="point"><float name="intensity" value="1e38"/></emitter>',
        '<emitter type="directional"><rgb name="irradiance" value="1 1e38 1"/></emitter>',
        '<shape type="sphere"><emitter type="area"><float name="radiance" value="1e38"/></emitter></shape>',
        '<medium type="homogeneous" id="m"><float name="emission" value="1e10"/>'
        '<float name="emission_scale" value="1e10"/></medium>',
    ],
)
def test_lights_whose_variance_is_no_float_are_refused(load, light):
    assert "1e+" in error_of(load, light)


# -- old files, and what is no file --------------------------------------------------------------------


@pytest.mark.parametrize("version", ["4.0.0", "3", "x"])
def test_other_versions_are_told_what_to_change(tmp_path, version):
    (tmp_path / "scene.xml").write_text(f'<scene version="{version}"/>')
    with pytest.raises(SceneError, match="for Mitsuba 2 and 3, write"):
        load_file(tmp_path / "scene.xml")


def test_text_and_other_things_are_no_file_names():
    with pytest.raises(SceneError, match="a file's name is wanted, got XML: '<scene"):
        load_file(f'<scene version="3.0.0">{SENSOR * 20}</scene>')
    with pytest.raises(SceneError, match="does not exist"):
        load_file("x" * 5000)
    with pytest.raises(SceneError, match="takes a file's name, not 3"):
        load_file(3)


# -- without end ---------------------------------------------------------------------------------------


def test_reading_nameless_plugins_never_looks_through_those_before(load, monkeypatch):
    looks = []
    monkeypatch.setattr(Node, "__iter__", lambda node: looks.append(len(node)) or dict.__iter__(node))
    scene = load('<shape type="sphere"/>' * 500)
    assert len(scene.shapes) == 500 and isinstance(scene.shapes[0], Shape)
    assert sum(looks) < 500


def test_defaults_made_of_defaults_are_limited_together(load):
    """Sixteen doublings of ten characters, in six thousand attributes: 4 GB."""
    chain = '<default name="a0" value="0123456789"/>'
    chain += "".join(f'<default name="a{k}" value="$a{k - 1}$a{k - 1}"/>' for k in range(1, 17))
    message = error_of(load, chain + "".join(f'<shape type="$a16.{k}"/>' for k in range(6000)))
    assert "the values of all $names together are longer than 16777216 characters" in message


def test_names_and_numbers_without_end_are_read_once(load):
    """A regular expression that goes back would take minutes on these."""
    number = f'<emitter type="point"><float name="intensity" value="{"9" * 300_000}x"/></emitter>'
    assert "…" in error_of(load, number) and len(error_of(load, number)) < 300
    name = error_of(load, f'<emitter type="${"a" * 1_000_000}"/>')
    assert "has no value" in name and len(name) < 300
    assert "cannot be the name of a default" in error_of(load, f'<default name="{"a" * 300}" value="1"/>')


def test_many_ids_are_compared_and_listed_in_part(load, monkeypatch):
    compared = []
    original = vocabulary.get_close_matches
    monkeypatch.setattr(
        vocabulary, "get_close_matches", lambda *a, **k: compared.append(len(a[1])) or original(*a, **k)
    )
    ids = "".join(f'<bsdf type="null" id="material{n}"/>' for n in range(3000))
    message = error_of(load, ids + '<shape type="cube"><ref id="materiel2999"/></shape>')
    assert "did you mean 'material2" in message and "and 2,936 more" in message
    assert compared == [vocabulary.MOST_COMPARED]


@pytest.mark.parametrize("value", ["x" * 100_000, "\n" * 100_000, "é" * 100_000])
def test_no_message_is_as_long_as_the_input(load, value):
    escaped = value.replace("\n", "&#10;")
    for element in (
        f'<emitter type="{escaped}"/>',
        f'<bsdf type="null" id="b"><float name="{escaped}" value="1"/></bsdf>',
        f'<shape type="cube"><ref id="{escaped}"/></shape>',
        f'<shape type="obj"><string name="filename" value="{escaped}"/></shape>',
        f'<include filename="{escaped}"/>',
        f'<bsdf type="null" id="b"><boolean name="a" value="{escaped}"/></bsdf>',
        f'<bsdf type="{escaped}" id="{escaped}"/>' * 2,
    ):
        assert len(error_of(load, element)) < 3 * LONGEST + 10


# -- what Mitsuba has made -----------------------------------------------------------------------------


def mitsubas(name, **parts):
    """An object of a class as Mitsuba's plugins are, with these attributes."""
    base = type("Object", (), {"__module__": "mitsuba"})
    return type(name, (base,), {"__module__": "mitsuba", **parts})()


def test_arrays_and_transforms_of_mitsuba_are_taken():
    grid = np.full((2, 3, 4), 0.5, np.float32)
    volume = {
        "type": "gridvolume",
        "grid": mitsubas("VolumeGrid", __array_interface__=grid.__array_interface__),
    }
    moved = type("AffineTransform4f", (), {"__module__": "mitsuba", "matrix": translate([1, 2, 3])})()
    medium = {"type": "heterogeneous", "sigma_t": volume}
    shape = {"type": "cube", "to_world": moved, "interior": medium, "bsdf": {"type": "null"}}
    scene = load_dict({"type": "scene", "camera": {"type": "perspective"}, "fog": shape})
    assert np.array_equal(scene.shapes[0].interior.sigma_t.grid.values[..., 0], grid)
    assert np.array_equal(scene.shapes[0].to_world, translate([1, 2, 3]))


def test_plugins_that_mitsuba_has_loaded_are_refused_with_what_to_do():
    camera = {"type": "perspective"}
    for scene, told in (
        ({"type": "scene", "camera": camera, "ball": mitsubas("Shape")}, "scene.ball: a Mitsuba Shape"),
        (
            {"type": "scene", "camera": camera | {"film": mitsubas("Film")}},
            "scene.camera.film: a Mitsuba Film",
        ),
        (mitsubas("Scene"), "scene: a Mitsuba Scene is loaded already"),
    ):
        with pytest.raises(SceneError, match=f"{told}.*; give the dict that mi.load_dict made it from"):
            load_dict(scene)
