"""The XML front end: defaults, includes, paths, references, transforms; and what it refuses."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest

from clvol.errors import SceneError
from clvol.scene import load_dict, load_file, look_at, rotate, scale, translate
from clvol.scene.records import DirectionalEmitter

SENSOR = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'


@pytest.fixture
def load(tmp_path):
    """Load a scene of a sensor and the given elements, which begin in line 2."""

    def load_text(elements, sensor=SENSOR, **defaults):
        (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">\n{elements}\n{sensor}</scene>\n')
        return load_file(tmp_path / "scene.xml", **defaults)

    return load_text


def error_of(load, elements, **options):
    with pytest.raises(SceneError) as caught:
        load(elements, **options)
    return str(caught.value)


def assert_same_scene(one, other, path="scene"):
    """Raise AssertionError at the first field in which two records differ by more than rounding."""
    assert type(one) is type(other), path
    if is_dataclass(one):
        for entry in fields(one):
            if entry.name not in ("source", "name", "files"):
                pair = (getattr(record, entry.name) for record in (one, other))
                assert_same_scene(*pair, f"{path}.{entry.name}")
    elif isinstance(one, np.ndarray):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12, err_msg=path)
    elif isinstance(one, tuple):
        assert len(one) == len(other), path
        for index, pair in enumerate(zip(one, other, strict=True)):
            assert_same_scene(*pair, f"{path}[{index}]")
    else:
        assert one == other, path


# -- what it understands ---------------------------------------------------------------------------


def the_same_as_a_dict(albedo):
    """The scene of the test below, with another albedo if wanted."""
    fog = {
        "type": "heterogeneous",
        "sigma_t": {
            "type": "gridvolume",
            "data": np.arange(24.0).reshape(2, 3, 4),
            "to_world": translate([-1, 0, 0]) @ scale(2),
        },
        "albedo": {"type": "rgb", "value": albedo},
        "scale": 50,
        "phase": {"type": "hg", "g": -0.5},
    }
    return load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 12, "technique": "delta"},
            "fog": fog,
            "ball": {
                "type": "sphere",
                "center": [1, 2, 3],
                "radius": 2,
                "bsdf": {"type": "null"},
                "interior": {"type": "ref", "id": "fog"},
            },
            "sun": {"type": "directional", "direction": [0, -2, 0]},
            "lamp": {"type": "point", "intensity": {"type": "spectrum", "value": 2.0}},
            "camera": {
                "type": "perspective",
                "to_world": look_at([1, 2, -3], [0, 0, 0], [0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": 64,
                    "height": 32,
                    "rfilter": {"type": "tent"},
                    "sample_border": True,
                },
                "sampler": {"type": "independent", "sample_count": 16},
            },
        }
    )


def test_xml_and_dict_make_the_same_scene(load, tmp_path):
    np.save(tmp_path / "fog.npy", np.arange(24.0).reshape(2, 3, 4))
    from_xml = load(
        """
        <integrator type="volpathmis">
            <integer name="max_depth" value="12"/> <string name="technique" value="delta"/>
        </integrator>
        <medium type="heterogeneous" id="fog">
            <volume type="gridvolume" name="sigma_t">
                <string name="filename" value="fog.npy"/>
                <transform name="to_world"><scale value="2"/><translate x="-1"/></transform>
            </volume>
            <rgb name="albedo" value="0.9, 0.8 0.7"/>
            <float name="scale" value="50"/>
            <phase type="hg"><float name="g" value="-.5"/></phase>
        </medium>
        <shape type="sphere" id="ball">
            <point name="center" x="1" y="2" z="3"/> <float name="radius" value="2"/>
            <bsdf type="null"/> <ref name="interior" id="fog"/>
        </shape>
        <emitter type="directional"><vector name="direction" value="0 -2 0"/></emitter>
        <emitter type="point"><spectrum name="intensity" value="2"/></emitter>""",
        sensor="""
        <sensor type="perspective">
            <transform name="to_world"><lookat origin="1,2,-3" target="0,0,0" up="0,1,0"/></transform>
            <film type="hdrfilm">
                <integer name="width" value="64"/> <integer name="height" value="32"/>
                <rfilter type="tent"/> <boolean name="sample_border" value="true"/>
            </film>
            <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
        </sensor>""",
    )
    assert_same_scene(from_xml, the_same_as_a_dict([0.9, 0.8, 0.7]))
    assert from_xml.emitters[0] == DirectionalEmitter((1.0,), (0.0, -1.0, 0.0))
    with pytest.raises(AssertionError, match="albedo"):
        assert_same_scene(from_xml, the_same_as_a_dict([0.9, 0.8, 0.71]))


def test_later_transforms_apply_after_earlier_ones(load):
    # The matrix was printed by Mitsuba 3.9.1 for the same text.
    scene = load(
        "",
        sensor="""<sensor type="perspective"><transform name="to_world">
        <translate x="1" y="2"/><rotate y="1" angle="30"/><rotate value="0.6 0 0.8" angle="-75"/>
        <translate value="1 2 3"/><lookat origin="1,2,-3" target="0.5 0.1 0.2" up="0,1,0"/>
        </transform></sensor>""",
    )
    mitsuba = [
        [0.3567107617855072, 0.8204310536384583, 0.44682249426841736, 3.4298901557922363],
        [-0.7975732684135437, 0.5164919495582581, -0.31162944436073303, 2.4425089359283447],
        [-0.4864506721496582, -0.2452121078968048, 0.8385921120643616, -0.2660512626171112],
        [0.0, 0.0, 0.0, 1.0],
    ]
    np.testing.assert_allclose(scene.sensor.to_world, mitsuba, atol=1e-6)
    assert not np.allclose(scene.sensor.to_world, rotate([0, 1, 0], 30))


def test_matrix_takes_nine_or_sixteen_numbers(load):
    shape = '<shape type="cube"><bsdf type="null"/><transform name="to_world">'
    shape += '<matrix value="%s"/></transform></shape>'
    nine = load(shape % "1 2 0 0 1 0 0 0 1").shapes[0].to_world
    sixteen = load(shape % "1 2 0 0 0 1 0 0 0 0 1 0 0 0 0 1").shapes[0].to_world
    np.testing.assert_array_equal(nine, sixteen)
    np.testing.assert_array_equal(nine[0], [1, 2, 0, 0])


def test_keywords_replace_defaults(load):
    text = '<default name="l" value="1"/><default name="light" value="3"/>'
    text += '<emitter type="constant"><float name="radiance" value="$light"/></emitter>'
    assert load(text).emitters[0].radiance == (3.0,)
    assert load(text, light=5).emitters[0].radiance == (5.0,)


def test_a_keyword_that_nothing_uses_is_an_error(load):
    assert "'brightness'" in error_of(load, "", brightness=2)
    message = error_of(load, '<default name="spp" value="2"/>', spp=4)
    assert "'spp'" in message


def test_an_unknown_name_is_an_error_with_its_line(load):
    message = error_of(load, '\n<emitter type="constant"><float name="radiance" value="$light"/></emitter>')
    assert "scene.xml:3: $light has no value" in message


def test_includes_bring_plugins_defaults_and_their_own_folder(load, tmp_path):
    (tmp_path / "parts").mkdir()
    np.save(tmp_path / "parts" / "fog.npy", np.ones((2, 2, 2)))
    (tmp_path / "parts" / "fog.xml").write_text(
        """<scene version="3.0.0"><default name="density" value="7"/>
        <medium type="heterogeneous" id="fog"><float name="scale" value="$density"/>
        <volume name="sigma_t" type="gridvolume"><string name="filename" value="fog.npy"/></volume>
        </medium></scene>"""
    )
    (tmp_path / "parts" / "light.xml").write_text('<emitter version="3.0.0" type="constant"/>')
    scene = load(
        """<include filename="parts/fog.xml"/><include filename="parts/light.xml"/>
        <shape type="cube"><bsdf type="null"/><ref id="fog" name="interior"/></shape>""",
        density=9,
    )
    assert scene.shapes[0].interior.scale == (9.0,)
    assert len(scene.emitters) == 1


def test_paths_are_searched_for_files(load, tmp_path):
    (tmp_path / "data").mkdir()
    np.save(tmp_path / "data" / "fog.npy", np.ones((2, 2, 2)))
    volume = '<volume type="gridvolume" id="v"><string name="filename" value="fog.npy"/></volume>'
    assert load(f'<path value="data"/>{volume}').sensor.fov == 40.0
    assert "file 'fog.npy' does not exist" in error_of(load, volume)


def test_a_medium_shared_by_reference_is_one_object(load):
    cube = '<shape type="cube"><bsdf type="null"/><ref name="interior" id="m"/></shape>'
    scene = load(cube + '<medium type="homogeneous" id="m"/>' + cube)
    assert scene.shapes[0].interior is scene.shapes[1].interior


# -- what it refuses -------------------------------------------------------------------------------

REFUSED = [
    ('<shape type="sphre"/>', "scene.xml:2: unknown shape 'sphre'; did you mean 'sphere'?"),
    ('<shape type="hg"/>', "'hg' is a phase, not a shape"),
    (
        '<medium type="homogeneous">\n<float name="sigmat" value="1"/></medium>',
        "scene.xml:3: unknown parameter",
    ),
    ('<medium type="homogeneous"><float name="sigmat" value="1"/></medium>', "did you mean 'sigma_t'?"),
    (
        '\n<emitter type="constant"><float name="radiance" value="abc"/></emitter>',
        "scene.xml:3: 'abc' is not",
    ),
    ('<emitter type="constant"><float name="radiance" value="1_0"/></emitter>', "not a number"),
    ('<emitter type="constant"><float name="radiance" value="nan"/></emitter>', "not a number"),
    ('<emitter type="constant"><float name="radiance" value="1e999"/></emitter>', "must be"),
    ('<integrator type="volpath"><integer name="rr_depth" value="1.5"/></integrator>', "not an integer"),
    ('<integrator type="volpath"><float name="rr_depth" value="1"/></integrator>', "must be an integer"),
    ('<integrator type="volpath"><boolean name="hide_emitters" value="1"/></integrator>', "not a boolean"),
    ('<emitter type="constant"><rgb name="radiance" value="1 2"/></emitter>', "1 or 3 numbers"),
    ('<emitter type="constant"><spectrum name="radiance" value="400:1 500"/></emitter>', "wavelength:value"),
    ('<emitter type="constant"><spectrum name="radiance" value="500:1 400:1"/></emitter>', "increasing"),
    ('<emitter type="constant"><rgb name="radiance" valu="1"/></emitter>', "unknown attribute 'valu'"),
    ('<emitter type="constant"><rgb name="radiance"/></emitter>', "needs the attribute 'value'"),
    ("<emitter/>", "needs the attribute 'type'"),
    ('<emmiter type="constant"/>', "unknown element <emmiter>; did you mean 'emitter'?"),
    ('<rotate x="1" angle="3"/>', "belongs into a <transform>"),
    ('<emitter type="point"><point name="position" x="1"/></emitter>', "needs x, y and z"),
    ('<shape type="cube"><transform name="to_world"><scale x="0"/></transform></shape>', "singular"),
    (
        '<shape type="cube"><transform name="to_world"><scal x="2"/></transform></shape>',
        "did you mean 'scale'?",
    ),
    (
        '<shape type="cube"><transform name="to_world">\n<rotate angle="2"/></transform></shape>',
        "scene.xml:3: rotate: the axis is zero",
    ),
    (
        '<shape type="cube"><ref id="fg" name="interior"/></shape><medium type="homogeneous" id="fog"/>',
        "'fog'",
    ),
    ('<medium type="homogeneous" id="a"/>\n<medium type="homogeneous" id="a"/>', "scene.xml:3: the id 'a'"),
    (
        '<phase type="hg"><float name="g" value=".1"/>\n<float name="g" value=".2"/></phase>',
        "scene.xml:3: 'g' is given twice",
    ),
    ('<include filename="scene.xml"/>', "includes itself"),
    ('<include filename="other.xml"/>', "scene.xml:2: file 'other.xml' does not exist"),
    ('<path value="nowhere"/>', "folder 'nowhere' does not exist"),
    ('<float name="x" value="1"/>', "unknown parameter 'x' of the scene"),
    ("some text", "unexpected text"),
    ('<emitter type="constant">', "broken XML"),
    ("<shape type='cube'>" * 5000 + "</shape>" * 5000, "nested"),
]


@pytest.mark.parametrize(("elements", "message"), REFUSED)
def test_what_cannot_be_understood_is_an_error(load, elements, message):
    assert message in error_of(load, elements)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE s [<!ENTITY a "x">]><scene version="3.0.0"/>', "entity 'a' is refused"),
        ('<!DOCTYPE s SYSTEM "file:///etc/passwd"><scene version="3.0.0"/>', "external document type"),
        ('<!DOCTYPE s [<!ENTITY % a SYSTEM "file:///x"> %a;]><scene version="3.0.0"/>', "refused"),
        ('<scene version="4.0.0"/>', "version '4.0.0' is not supported"),
        ("<scene/>", "the version is missing"),
        ('<shape type="cube" version="3.0.0"/>', "the root element must be <scene>"),
        ('<scene version="3.0.0"/>', "the scene has no sensor"),
        ('<?xml version="1.0" encoding="shift-jis-2000"?><scene/>', "encoding"),
        ("", "is empty"),
    ],
)
def test_hostile_and_foreign_files_are_refused(tmp_path, text, message):
    (tmp_path / "scene.xml").write_text(text)
    with pytest.raises(SceneError, match=r"scene\.xml") as caught:
        load_file(tmp_path / "scene.xml")
    assert message in str(caught.value)


def test_defaults_that_grow_without_end_are_refused(load):
    bomb = '<default name="a0" value="0123456789"/>'
    for level in range(1, 30):
        bomb += f'<default name="a{level}" value="{f"$a{level - 1} " * 10}"/>'
    assert "longer than" in error_of(load, bomb)


def test_includes_that_multiply_without_end_are_refused(load, tmp_path):
    for level in range(20):
        twice = f'<include filename="{level + 1}.xml"/>' * 2
        (tmp_path / f"{level}.xml").write_text(f'<scene version="3.0.0">{twice}</scene>')
    (tmp_path / "20.xml").write_text('<scene version="3.0.0"/>')
    assert "more than 1000 files" in error_of(load, '<include filename="0.xml"/>')


def test_a_missing_scene_file_is_an_error(tmp_path):
    with pytest.raises(SceneError, match="does not exist"):
        load_file(tmp_path / "none.xml")
