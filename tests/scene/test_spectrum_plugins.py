"""Spectra that are plugins: the colours that Mitsuba 3.9.1 sees in them, and where they may stand."""

import numpy as np
import pytest

import clvol
from clvol.scene import spectra
from clvol.scene.loader import load_plugin

TABLE = {"wavelength_min": 400.0, "wavelength_max": 700.0, "values": "0.1, 0.5, 0.9"}


def light(**plugin):
    return load_plugin({"type": "constant", "radiance": plugin}, {}).radiance


def reflectance(**plugin):
    return load_plugin({"type": "diffuse", "reflectance": plugin}, {}).reflectance


@pytest.mark.parametrize(
    ("plugin", "color"),
    [
        ({"type": "uniform", "value": 0.5}, (0.5,)),
        ({"type": "uniform"}, (1.0,)),
        ({"type": "rawconstant", "value": 0.3}, (0.3,)),
        ({"type": "rawconstant", "value": [0.1, 0.2, 0.3]}, (0.1, 0.2, 0.3)),
        ({"type": "srgb", "color": [0.1, 0.2, 0.3]}, (0.1, 0.2, 0.3)),
        ({"type": "d65", "color": np.array([0.1, 0.2, 0.3])}, (0.1, 0.2, 0.3)),
        ({"type": "srgb", "color": {"type": "rgb", "value": [0.1, 0.2, 0.3]}}, (0.1, 0.2, 0.3)),
        ({"type": "d65"}, (1.0,)),
        ({"type": "d65", "scale": 0.5, "color": {"type": "rgb", "value": [0.2, 0.4, 0.6]}}, (0.1, 0.2, 0.3)),
    ],
)
def test_colours_are_those_of_mitsubas_rgb_variants(plugin, color):
    """mi.load_dict(plugin).eval(si) in scalar_rgb, alone and as radiance of a constant emitter."""
    assert light(**plugin) == pytest.approx(color)
    assert reflectance(**plugin) == pytest.approx(color)


def test_tables_are_what_pairs_of_wavelength_and_value_are():
    pairs = {"type": "spectrum", "value": [(400, 0.1), (550, 0.5), (700, 0.9)]}
    for table in (
        {"type": "regular", **TABLE},
        {"type": "irregular", "wavelengths": [400, 550, 700], "values": np.array([0.1, 0.5, 0.9])},
    ):
        assert light(**table) == light(**pairs)
        assert reflectance(**table) == reflectance(**pairs)


def test_black_bodies_have_plancks_radiance(monkeypatch):
    """Those of mi.load_dict({"type": "blackbody", "temperature": 5000}).eval(si) in scalar_spectral."""
    seen = {}

    def keep(wavelengths, values, of_light):
        seen[of_light] = np.interp([450, 550, 650, 800], wavelengths, values)
        return np.ones(3)

    monkeypatch.setattr(spectra, "sampled_to_rgb", keep)
    light(type="blackbody", temperature=5000.0)
    np.testing.assert_allclose(seen[True], [10801.1, 12713.0, 12415.3, 10242.7], rtol=1e-4)


def test_black_bodies_have_their_colour():
    warm, cold = light(type="blackbody", temperature=2000.0), light(type="blackbody", temperature=12000.0)
    assert warm[0] > warm[1] > warm[2] and cold[2] > cold[1] > cold[0] and cold[1] > 50 * warm[1]


def test_they_are_read_from_xml_and_by_ref():
    scene = clvol.load_string(
        """<scene version="3.0.0"> <sensor type="perspective"/>
        <texture type="d65" id="day"> <float name="scale" value="2"/> </texture>
        <emitter type="constant"> <ref id="day" name="radiance"/> </emitter>
        <emitter type="point">
          <spectrum type="uniform" name="intensity"> <float name="value" value="3"/> </spectrum> </emitter>
        <medium type="homogeneous" id="fog">
          <spectrum type="uniform" name="sigma_t"> <float name="value" value="4"/> </spectrum>
          <texture type="regular" name="albedo"> <string name="values" value="0.5 0.5"/> </texture> </medium>
        <shape type="sphere"> <bsdf type="null"/> <ref id="fog" name="interior"/> </shape> </scene>"""
    )
    sky, lamp = scene.emitters
    assert (sky.radiance, lamp.intensity) == ((2.0,), (3.0,))
    fog = scene.shapes[0].interior
    assert fog.sigma_t.value == (4.0,) and np.allclose(fog.albedo.value, 0.5, atol=0.03)


@pytest.mark.parametrize(
    ("plugin", "message"),
    [
        ({"type": "uniform", "value": -1.0}, r"in \[0"),
        ({"type": "uniform", "value": "x"}, "a number"),
        ({"type": "d65", "scale": -1.0}, r"in \[0"),
        ({"type": "d65", "colour": 1.0}, "did you mean 'color'"),
        ({"type": "regular"}, "needs values"),
        ({"type": "regular", **TABLE, "wavelength_max": 400.0}, "greater than wavelength_min"),
        ({"type": "regular", "values": "1, x"}, "'x', which is no number"),
        ({"type": "regular", "values": "1"}, "2 to 65536 numbers"),
        ({"type": "regular", "values": [1.0, np.nan]}, "finite and >= 0"),
        (
            {"type": "irregular", "values": "1, 2", "wavelengths": "400, 500, 600"},
            "3 wavelengths have 2 values",
        ),
        ({"type": "irregular", "values": "1, 2", "wavelengths": "500, 400"}, "must increase"),
        ({"type": "rawconstant", "value": [1.0, 2.0]}, "three finite numbers"),
        ({"type": "rawconstant", "value": [1.0, 2.0, -1.0]}, "'radiance' .* must be in"),
        ({"type": "srgb", "color": [1.0, np.nan, 0.0]}, "three finite numbers"),
        ({"type": "uniform", "value": [1.0, 1.0, 1.0]}, "must be a number"),
        ({"type": "blackbody", "temperature": 0.0}, "temperature"),
        ({"type": "blackbody", "scale": 2.0}, "unknown parameter 'scale'"),
    ],
)
def test_what_makes_no_spectrum_is_refused(plugin, message):
    with pytest.raises(clvol.SceneError, match=message):
        light(**plugin)


PAIRS = [(400.0, 0.1), (500.0, 0.7), (600.0, 0.3), (700.0, 0.9)]
FILE = "# a comment\n400 0.1\n500\t0.7 # another\n\n600 3e-1\r\n700 0.9"


def test_spectra_are_read_from_files(tmp_path, monkeypatch):
    """Mitsuba 3.9.1 has these colours in them, in scalar_rgb."""
    (tmp_path / "a.spd").write_text(FILE)
    monkeypatch.chdir(tmp_path)
    assert reflectance(type="spectrum", filename="a.spd") == pytest.approx(
        (0.311179, 0.550709, 0.413553), rel=1e-4
    )
    assert light(type="spectrum", filename="a.spd") == light(type="spectrum", value=PAIRS)


def test_files_of_spectra_are_relative_to_the_scene(tmp_path):
    (tmp_path / "a.spd").write_text(FILE)
    text = (
        '<scene version="{}"><sensor type="perspective"/><emitter type="{}">'
        '<spectrum name="{}" filename="a.spd"/></emitter></scene>'
    )
    (tmp_path / "new.xml").write_text(text.format("3.0.0", "constant", "radiance"))
    (tmp_path / "old.xml").write_text(text.format("0.5.0", "constant", "radiance"))
    for name in ("new.xml", "old.xml"):
        [emitter] = clvol.load_file(str(tmp_path / name)).emitters
        assert emitter.radiance == light(type="spectrum", value=PAIRS)
    assert str(tmp_path / "a.spd") in clvol.load_file(str(tmp_path / "new.xml")).files


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"400 1\n500 x", "line 2 of 'a.spd' is no wavelength and value: '500 x'"),
        (b"400 1 2\n500 1", "line 1"),
        (b"", "at least two wavelength:value pairs"),
        (b"500 1\n400 1", "increasing wavelengths"),
        (b"400 1\n500 nan", "increasing wavelengths"),
        (b"400 1\n500 -1", "values >= 0"),
        (bytes(range(256)), "is no wavelength"),
        (b"400 1\n" * 300_000, "too long"),
    ],
    ids=lambda value: "",
)
def test_broken_files_of_spectra_are_refused(content, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.spd").write_bytes(content)
    with pytest.raises(clvol.SceneError, match=message):
        light(type="spectrum", filename="a.spd")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"filename": "b.spd"}, "'b.spd' does not exist"),
        ({"filename": "b.spd", "value": 1.0}, "either a filename or a value"),
        ({"filename": 3}, "the name of a file"),
    ],
    ids=lambda value: "",
)
def test_mistakes_with_files_of_spectra_are_named(given, message):
    with pytest.raises(clvol.SceneError, match=message):
        light(type="spectrum", **given)
