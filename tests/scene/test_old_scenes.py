"""Scenes of Mitsuba 0.3 to 1 mean what they meant: read as version 3 has it in other words."""

import subprocess
import sys

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

import clvol
from clvol.scene import look_at, scale, translate
from clvol.scene.digest import scene_digest
from clvol.scene.materials import Diffuse, Null
from clvol.scene.upgrade import snake_case
from clvol.volumes import write_vol

SENSOR = '<sensor type="perspective"/>'


def old(*elements, version="0.5.0", sensor=SENSOR):
    return clvol.load_string(f'<scene version="{version}">{sensor}{"".join(elements)}</scene>')


def new(*elements, sensor=SENSOR):
    return clvol.load_string(f'<scene version="3.0.0">{sensor}{"".join(elements)}</scene>')


def same(one, other):
    return (scene_digest(one), one.spp) == (scene_digest(other), other.spp)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ("toWorld", "to_world"),
        ("intIOR", "int_ior"),
        ("sigmaT", "sigma_t"),
        ("uoffset", "uoffset"),
        ("B", "B"),
    ],
)
def test_names_are_upgraded_as_mitsuba_upgrades_them(given, wanted):
    assert snake_case(given) == wanted


def test_a_whole_old_scene_is_a_new_one():
    before = old(
        """<integrator type="volpath_simple"><integer name="maxDepth" value="8"/>
            <integer name="rrDepth" value="9"/><boolean name="strictNormals" value="true"/></integrator>
        <medium id="milk" type="homogeneous"><spectrum name="sigmaS" value="1, 2, 3"/>
            <spectrum name="sigmaA" value="1"/><float name="scale" value="4"/></medium>
        <shape type="cube"><transform name="toWorld"><scale value="2"/></transform>
            <ref name="interior" id="milk"/></shape>
        <shape type="sphere"><bsdf type="diffuse"><srgb name="diffuseReflectance" value="#ff8000"/></bsdf>
        </shape>
        <emitter type="point"><spectrum name="intensity" value="5" intent="illuminant"/></emitter>""",
        sensor="""<sensor type="perspective"><float name="fov" value="45"/><string name="fovAxis" value="x"/>
            <transform name="toWorld"><lookAt target="0, 0, 0" origin="0  0  9"/></transform>
            <sampler type="ldsampler"><integer name="sampleCount" value="16"/></sampler>
            <film type="ldrfilm"><integer name="width" value="9"/><integer name="height" value="8"/>
            <boolean name="banner" value="false"/><float name="gamma" value="2.2"/>
            <string name="pixelFormat" value="luminance"/></film></sensor>""",
    )
    after = new(
        """<integrator type="volpath"><integer name="max_depth" value="8"/>
            <integer name="rr_depth" value="9"/></integrator>
        <medium id="milk" type="homogeneous"><rgb name="sigma_t" value="2, 3, 4"/>
            <rgb name="albedo" value="0.5, 0.6666666666666666, 0.75"/><float name="scale" value="4"/></medium>
        <shape type="cube"><transform name="to_world"><scale value="2"/></transform>
            <ref name="interior" id="milk"/><bsdf type="null"/></shape>
        <shape type="sphere"><bsdf type="diffuse">
            <rgb name="reflectance" value="1, 0.21586050011389926, 0"/></bsdf></shape>
        <emitter type="point"><rgb name="intensity" value="5"/></emitter>""",
        sensor="""<sensor type="perspective"><float name="fov" value="45"/>
            <transform name="to_world"><lookat target="0, 0, 0" origin="0,0,9" up="1, 0, 0"/></transform>
            <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
            <film type="hdrfilm"><integer name="width" value="9"/><integer name="height" value="8"/>
            </film></sensor>""",
    )
    assert same(before, after)
    assert len(before.approximated) == 3  # the integrator, the sampler and the film


def test_a_film_of_matrices_has_one_pixel_and_no_filter():
    """By the documentation of 0.6's `mfilm`: width and height are 1, and the filter is a box."""
    sensor = '<sensor type="{}"><film type="{}">{}</film></sensor>'
    before = old(sensor=sensor.format("radiancemeter", "mfilm", '<string name="fileFormat" value="numpy"/>'))
    assert (before.film.width, before.film.height, before.film.rfilter.kind) == (1, 1, "box")
    size = '<integer name="width" value="6"/><integer name="height" value="3"/><rfilter type="tent"/>'
    before = old(sensor=sensor.format("perspective", "mfilm", size))
    after = new(sensor=sensor.format("perspective", "hdrfilm", size))
    assert same(before, after)


def test_a_film_of_matrices_takes_a_filter_by_its_name():
    film = '<film type="mfilm"><ref id="f"/></film>'
    film = f'<rfilter type="tent" id="f"/><sensor type="perspective">{film}</sensor>'
    assert old(sensor=film).film.rfilter.kind == "tent"


def test_a_texture_stands_for_the_value_of_its_name():
    """As 0.6 has it: the value is read first, and the texture takes its place."""
    texture = '<texture name="reflectance" type="checkerboard"/>'
    both = f'<shape type="sphere"><bsdf type="diffuse">{{}}{texture}</bsdf></shape>'
    value = '<spectrum name="reflectance" value="0.5"/>'
    assert same(old(both.format(value)), old(both.format("")))
    named = texture.replace('name="reflectance"', 'id="t"')
    bsdf = f'<bsdf type="diffuse">{value}<ref name="reflectance" id="t"/></bsdf>'
    by_name = f'{named}<shape type="sphere">{bsdf}</shape>'
    assert same(old(by_name), old(both.format("")))
    with pytest.raises(clvol.SceneError, match="given twice"):
        new(both.format('<rgb name="reflectance" value="0.5"/>'))


def test_a_view_without_up_is_mitsubas():
    """Its matrix is what Mitsuba 3.9.1 prints."""
    view = '<sensor type="perspective"><transform name="to_world"><lookat origin="0,0,20" target="0,0,0"/>'
    matrix = new(sensor=f"{view}</transform></sensor>").sensor.to_world
    assert np.array_equal(matrix, [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 20], [0, 0, 0, 1]])
    assert np.array_equal(matrix, look_at([0, 0, 20], [0, 0, 0], [1, 0, 0]))


def test_old_grids_lie_in_the_box_of_their_file(tmp_path):
    write_vol(tmp_path / "a.vol", np.ones((2, 2, 2), np.float32), box=((1, 2, 3), (3, 4, 6)))
    parts = f'<string name="filename" value="{tmp_path}/a.vol"/><boolean name="sendData" value="true"/>'
    medium = '<shape type="cube"><medium name="interior" type="heterogeneous"><string name="method" \
value="woodcock"/><float name="stepSize" value="1"/>\
<volume name="density" type="gridvolume">{}</volume></medium></shape>'
    found = old(medium.format(parts)).shapes[0]
    assert isinstance(found.bsdf, Null)
    corners = found.interior.sigma_t.index_to_world @ [[-0.5, 1.5], [-0.5, 1.5], [-0.5, 1.5], [1, 1]]
    assert np.allclose(corners[:3].T, [(1, 2, 3), (3, 4, 6)])
    box = '<point name="min" x="0" y="0" z="1"/><point name="max" x="2" y="2" z="2"/>'
    moved = f'{box}<transform name="toWorld"><translate x="5"/></transform>'
    placed = old(medium.format(parts + moved)).shapes[0].interior.sigma_t.index_to_world
    assert np.allclose(placed, translate([5, 0, 1]) @ scale([2, 2, 1]) @ scale(0.5) @ translate(0.5))


def test_only_old_shapes_with_a_medium_and_no_bsdf_let_light_pass():
    shape = '<shape type="cube"><medium name="interior" type="homogeneous"/></shape>'
    assert isinstance(old(shape).shapes[0].bsdf, Null)
    assert isinstance(new(shape).shapes[0].bsdf, Diffuse)
    assert isinstance(old('<shape type="cube"/>').shapes[0].bsdf, Diffuse)


def test_offsets_and_scales_of_textures_are_their_to_uv():
    parts = '<float name="uoffset" value="0.5"/><float name="vscale" value="3"/>'
    wall = '<shape type="cube"><bsdf type="diffuse">\
<texture name="reflectance" type="checkerboard">{}</texture></bsdf></shape>'
    steps = '<transform name="to_uv"><translate x="0.5"/><scale y="3"/></transform>'
    assert same(old(wall.format(parts)), new(wall.format(steps)))


def test_versions_from_2_on_are_not_upgraded():
    shape = '<shape type="cube"><transform name="toWorld"/></shape>'
    with pytest.raises(
        clvol.SceneError, match="unknown parameter 'toWorld' of shape 'cube'; did you mean 'to_world'"
    ):
        clvol.load_string(f'<scene version="2.0.0">{SENSOR}{shape}</scene>')
    old(shape, version="1.2.3")


def test_old_names_that_are_misspelt_are_faults_of_their_lines():
    text = (
        f'<scene version="0.6.0">{SENSOR}\n<shape type="cube"><float name="flipNormal" value="1"/></shape>\n\
<texture type="scale"><animation/></texture></scene>'
    )
    with pytest.raises(clvol.SceneError) as caught:
        clvol.load_string(text)
    assert "the text:2: unknown parameter 'flip_normal' of shape 'cube'" in str(caught.value)
    assert "the text:3: unknown element <animation>" in str(caught.value)


@pytest.mark.parametrize("value", ['integer name="{}" value="6"', 'rgb name="{}" value="1, 2, 3"'])
def test_a_parameter_that_mitsuba_06_had_not_is_not_heeded_as_there_and_said(value):
    shape = f"""<shape type="sphere"><emitter type="area"><spectrum name="radiance" value="1"/>
        <{value.format("zzTop")}/></emitter></shape>"""
    plain = (
        '<shape type="sphere"><emitter type="area"><spectrum name="radiance" value="1"/></emitter></shape>'
    )
    found = old(shape)
    said = "'zz_top' of emitter 'area' is not heeded: Mitsuba 0.6 has no such parameter"
    assert found.approximated == (said,)
    assert same(found, old(plain))
    assert clvol.render(found, spp=1, size=(4, 4)).metadata["approximated"] == said
    with pytest.raises(clvol.SceneError, match="unknown parameter 'zzTop' of emitter 'area'"):
        new(shape)


@pytest.mark.parametrize(
    ("scene", "name"),
    [
        ('<medium id="m" type="homogeneous"><string name="material" value="skimmilk"/></medium>', "material"),
        ('<bsdf id="b" type="conductor"><string name="extEta" value="water"/></bsdf>', "ext_eta"),
        (
            '<volume id="v" type="constvolume"><float name="value" value="1"/><phase type="hg"/></volume>',
            "phase",
        ),
    ],
)
def test_what_mitsuba_06_had_and_plugins_are_no_unknown_parameters(scene, name):
    user = {
        "m": '<shape type="cube"><ref name="interior" id="m"/></shape>',
        "b": '<shape type="cube"><ref id="b"/></shape>',
        "v": """<shape type="cube"><medium name="interior" type="heterogeneous"><ref name="density" id="v"/>
            <spectrum name="albedo" value="1"/></medium></shape>""",
    }
    with pytest.raises(clvol.SceneError, match=name):
        old(scene, user[scene.split('"')[1]])


def test_a_scene_that_is_written_anew_has_no_parameter_that_was_not_heeded(tmp_path):
    integrator = '<integrator type="volpath"><integer name="zzTop" value="6"/></integrator>'
    lamp = '<emitter type="point"><rgb name="zzTop" value="1, 2, 3"/></emitter>'
    (tmp_path / "old.xml").write_text(f'<scene version="0.5.0">{SENSOR}{integrator}{lamp}</scene>')
    command = [
        sys.executable,
        "-m",
        "clvol",
        "scene",
        str(tmp_path / "old.xml"),
        "-o",
        str(tmp_path / "new.xml"),
    ]
    subprocess.run(command, check=True, capture_output=True)
    assert "zz" not in (tmp_path / "new.xml").read_text().split("-->")[-1]
    assert same(clvol.load_file(tmp_path / "new.xml"), clvol.load_file(tmp_path / "old.xml"))


def test_what_is_written_into_or_on_a_picture_is_left_out():
    film = """<sensor type="perspective"><film type="hdrfilm">{}</film></sensor>"""
    named = """<string name="metadata['renderTime']" value="$scene['renderTime']"/>
        <string name="label[10, 10]" value="$integrator['maxDepth']"/>"""
    found = old(sensor=film.format(named))
    assert same(found, old(sensor=film.format(""))) and not found.approximated
    with pytest.raises(clvol.SceneError, match="scene has no value"):
        new(sensor=film.format(named))


def test_what_only_sped_mitsuba_06_up_is_left_out():
    samples = '<integer name="sampleCount" value="4"/>'
    ours = f'<sensor type="perspective"><sampler type="stratified">{samples}</sampler></sensor>'
    theirs = ours.replace(samples, samples + '<integer name="dimension" value="4"/>')
    photons = """<integrator type="ptracer"><integer name="granularity" value="9"/>
        <boolean name="bruteForce" value="true"/></integrator>"""
    assert same(old(photons, sensor=theirs), old('<integrator type="ptracer"/>', sensor=ours))
    assert not [said for said in old(photons, sensor=theirs).approximated if "not heeded" in said]


def test_media_take_scattering_and_absorption_together():
    medium = '<shape type="cube"><medium name="interior" type="homogeneous">{}</medium></shape>'
    s, a = '<float name="sigma_s" value="3"/>', '<float name="sigma_a" value="1"/>'
    found = new(medium.format(s + a)).shapes[0].interior
    assert (found.sigma_t.value, found.albedo.value) == ((4.0,), (0.75,))
    none = new(medium.format(s.replace("3", "0") + a.replace("1", "0"))).shapes[0].interior
    assert (none.sigma_t.value, none.albedo.value) == ((0.0,), (0.0,))
    for parts, told in (
        (s, "needs 'sigma_a' too"),
        (s + a + '<float name="albedo" value="1"/>', "either sigma_t"),
    ):
        with pytest.raises(clvol.SceneError, match=told):
            new(medium.format(parts))


METALS = {
    "": "Cu",
    '<string name="material" value="Au"/>': "Au",
    '<string name="material" value="none"/>': "none",
}


@pytest.mark.parametrize("plugin", ["conductor", "roughconductor"])
def test_a_metal_without_a_name_was_copper(plugin):
    for given, name in METALS.items():
        wanted = f'<bsdf type="{plugin}"><string name="material" value="{name}"/></bsdf>'
        shape = '<shape type="sphere">{}</shape>'.format
        assert same(old(shape(f'<bsdf type="{plugin}">{given}</bsdf>')), new(shape(wanted)))
    numbers = '<rgb name="eta" value="1, 2, 3"/><rgb name="k" value="3, 2, 1"/>'
    own = f'<shape type="sphere"><bsdf type="{plugin}">{numbers}</bsdf></shape>'
    assert same(old(own), new(own))


@pytest.mark.parametrize(
    ("gamma", "raw", "said"), [("1", True, 0), ("-1", False, 0), ("sRGB", False, 0), ("1.8", False, 1)]
)
def test_a_texture_of_gamma_one_is_raw(gamma, raw, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pixels = oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, "uint8"))
    oiio.ImageBufAlgo.fill(pixels, (0.5, 0.2, 0.7))
    pixels.write("a.png")

    def scene(make, parameter):
        file = '<string name="filename" value="a.png"/>'
        texture = f'<texture type="bitmap" name="reflectance">{file}{parameter}</texture>'
        return make(f'<shape type="sphere"><bsdf type="diffuse">{texture}</bsdf></shape>')

    found = scene(old, f'<string name="gamma" value="{gamma}"/>')
    assert same(found, scene(new, f'<boolean name="raw" value="{str(raw).lower()}"/>'))
    assert len(found.approximated) == said


def test_what_changes_the_picture_and_is_not_heeded_is_said():
    shape = '<shape type="sphere"><float name="maxSmoothAngle" value="30"/></shape>'
    sensor = '<sensor type="perspective"><film type="hdrfilm">{}</film></sensor>'.format
    film = '<string name="pixelFormat" value="spectrumAlpha"/>'
    film += '<rfilter type="box"><float name="radius" value="2"/></rfilter>'
    found = old(shape, sensor=sensor(film))
    assert [("max_smooth_angle" in said, "radius" in said) for said in found.approximated] == [
        (False, True),
        (True, False),
    ]
    assert found.film.pixel_format == "rgba"
    wide = sensor('<rfilter type="tent"><float name="radius" value="2"/></rfilter>')
    assert same(old(sensor=wide), new(sensor=wide))


@pytest.mark.parametrize(
    ("before", "now"),
    [
        ('type="sky"', {"albedo": 0.2, "sun_scale": 0}),
        ('type="sky">scale=3 resolution=64 turbidity=4', {"sky_scale": 3, "sun_scale": 0, "turbidity": 4}),
        ('type="sun">scale=3', {"sun_scale": 3, "sky_scale": 0}),
        (
            'type="sunsky">scale=3 skyScale=2 sunRadiusScale=2',
            {"sun_scale": 3, "sky_scale": 2, "sun_aperture": 1.0716},
        ),
        ('type="sunsky">sunRadiusScale=0', {"sun_aperture": 1e-4}),
        ('type="sunsky">hour=9 longitude=130', {"hour": 9, "longitude": 130}),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_skies_and_suns_are_a_sunsky_whose_y_is_up(before, now):
    """Its axes are those that Mitsuba 0.6 documents for the azimuth: x is east and z south."""
    plugin, _, parameters = before.partition(">")
    given = "".join('<float name="{}" value="{}"/>'.format(*one.split("=")) for one in parameters.split())
    wanted = "".join(
        f'<float name="{name}" value="{value}"/>' for name, value in ({"albedo": 0.2} | now).items()
    )
    frame = '<transform name="toWorld"><rotate x="1" angle="90"/></transform>'
    found = old(f"<emitter {plugin}>{given}{frame}</emitter>")
    matrix = '<matrix value="0 -1 0 0  0 0 1 0  1 0 0 0  0 0 0 1"/><rotate x="1" angle="90"/>'
    to_world = f'<transform name="to_world">{matrix}</transform>'
    assert same(found, new(f'<emitter type="sunsky">{wanted}{to_world}</emitter>'))


def test_an_old_sun_at_noon_is_high_in_the_south():
    [_, sun] = old('<emitter type="sunsky"><float name="hour" value="11.7"/></emitter>').emitters
    assert sun.sun_direction[1] > 0.9 and sun.sun_direction[2] > 0.2 and abs(sun.sun_direction[0]) < 0.05
    [_, sun] = old('<emitter type="sunsky"><float name="hour" value="8"/></emitter>').emitters
    assert sun.sun_direction[0] > 0.7


def test_what_an_old_sky_below_the_horizon_had_is_said():
    assert (
        "horizon" in old('<emitter type="sky"><float name="stretch" value="1.2"/></emitter>').approximated[0]
    )


def test_mixtures_of_any_number_are_blends_of_two():
    def mixture(kind, weights, *parts):
        inside = f'<string name="weights" value="{weights}"/>' + "".join(parts)
        return f'<{kind} type="mixture{kind}">{inside}</{kind}>'

    def ball(bsdf):
        return f'<shape type="sphere">{bsdf}</shape>'

    def fog(phase):
        return f'<shape type="cube"><medium name="interior" type="homogeneous">{phase}</medium></shape>'

    a, b, c = '<bsdf type="diffuse"/>', '<bsdf type="plastic"/>', '<bsdf type="null"/>'
    three = old(ball(mixture("bsdf", "0.2 0.3, 0.5", a, b, c))).shapes[0].bsdf
    assert three.weight == (pytest.approx(0.8),) and three.second.weight == (pytest.approx(0.625),)
    assert isinstance(three.first, Diffuse) and isinstance(three.second.second, Null)
    dark = old(ball(mixture("bsdf", "0.5, 0.25", a, c))).shapes[0].bsdf
    assert dark.second.weight == (0.5,) and dark.second.second.reflectance == (0.0,)
    bright = old(ball(mixture("bsdf", "2, 6", a, c))).shapes[0].bsdf
    assert bright.weight == (0.75,)
    lobes = '<phase type="isotropic"/>', '<phase type="hg"><float name="g" value="0.5"/></phase>'
    thin = old(fog(mixture("phase", "0.1, 0.3", *lobes)))
    assert (
        thin.shapes[0].interior.phase.weight == pytest.approx(0.75) and "add up to 1" in thin.approximated[0]
    )
    alone = old('<bsdf id="x" type="plastic"/>', ball(mixture("bsdf", "1", '<ref id="x"/>'))).shapes[0].bsdf
    assert alone.first is alone.second
    wrong = {"1": "as many weights", "1, x": "must be numbers", "0, 0": "not all 0", "1, nan": ">= 0"}
    for weights, told in wrong.items():
        with pytest.raises(clvol.SceneError, match=told):
            old(ball(mixture("bsdf", weights, a, b)))
    with pytest.raises(clvol.SceneError, match="unknown bsdf 'mixturebsdf'"):
        new(ball(mixture("bsdf", "1, 2", a, b)))


def test_plugins_that_mitsuba_3_has_not_either_are_told_at_once_with_what_to_take(tmp_path):
    parts = ["""<shape type="hair"/>""", '<emitter type="collimated"/>']
    for name in ("phong", "ward", "coating"):
        parts.append(f'<shape type="sphere"><bsdf type="{name}"/></shape>')
    (tmp_path / "old.xml").write_text(f'<scene version="0.6.0">{SENSOR}\n' + "\n".join(parts) + "</scene>")
    with pytest.raises(clvol.SceneError) as caught:
        clvol.load_file(tmp_path / "old.xml")
    lines = [line.strip().removeprefix(f"{tmp_path}/") for line in str(caught.value).splitlines()]
    beginnings = [
        "5 faults in the scene:",
        "old.xml:2: shape 'hair' is not supported, and Mitsuba 3 has none; take bsplinecurve, or linearcurve",
        "old.xml:3: emitter 'collimated' is not supported, and Mitsuba 3 has none; take a spot of small",
        "old.xml:4: bsdf 'phong' is not supported, and Mitsuba 3 has none; take roughplastic, or roughcond",
        "old.xml:5: bsdf 'ward' is not supported, and Mitsuba 3 has none; take roughconductor with alpha_u",
        "old.xml:6: bsdf 'coating' is not supported, and Mitsuba 3 has none; take plastic, a coat on",
    ]
    for line, beginning in zip(lines, beginnings, strict=False):
        assert line.startswith(beginning)
    assert "--skip-unsupported" in lines[-1] or "skip_unsupported" in lines[-1]
