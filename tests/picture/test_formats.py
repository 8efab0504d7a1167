"""Pictures in every format: what each holds, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner

from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.picture.dither import codes
from clvol.picture.estimate import Moments
from clvol.picture.formats import FORMATS, is_linear
from clvol.picture.image_io import shown_pixels
from clvol.picture.result import Result
from clvol.picture.view_transform import View

if TYPE_CHECKING:
    from pathlib import Path

HEIGHT, WIDTH = 32, 40
MADE = [suffix for suffix, form in FORMATS.items() if form.plugin in oiio.get_string_attribute("format_list")]
"""Older versions of OpenImageIO make no .jxl."""
SCENE = """<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">
<integer name="width" value="8"/><integer name="height" value="4"/>{film}</film></sensor>
<emitter type="constant"/></scene>"""


def make_result(alpha: bool = False) -> Result:
    """A smooth picture: formats that lose something lose little of it."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / 24.0
    image = np.stack([0.2 + 0.5 * x, 0.1 + y * y, 0.8 - 0.3 * y], axis=-1)
    about = {"technique": "delta", "spp": 4, "version": "1.2.3", "scene": "naïve.xml"}
    aovs = {"lookups": np.full((HEIGHT, WIDTH), 1e-7, np.float32)}
    if alpha:
        aovs["alpha"] = np.float32(np.clip(x, 0, 1))
        image *= aovs["alpha"][..., None]
    return Result.from_estimate(Moments(4 * image, 4 * image**2 + 1e-6, 4), (0, 4), aovs, {}, about)


def read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, object], str]:
    """Channels by name, attributes, and the type of the numbers, of a picture on disk, as it is there."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    opened = oiio.ImageInput.open(str(path), config)
    assert opened is not None, oiio.geterror()
    spec = opened.spec()
    pixels = opened.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
    opened.close()
    channels = {name: pixels[..., n] for n, name in enumerate(spec.channelnames)}
    return channels, {a.name: a.value for a in spec.extra_attribs}, str(spec.format)


def colours(channels: dict[str, np.ndarray]) -> np.ndarray:
    return np.stack([channels[label] for label in "RGB"], axis=-1)


@pytest.mark.parametrize("suffix", MADE)
def test_every_format_holds_the_picture(tmp_path: Path, suffix: str) -> None:
    result, form = make_result(), FORMATS[suffix]
    result.save(tmp_path / f"a{suffix.upper()}")
    channels, _, kind = read(tmp_path / f"a{suffix.upper()}")
    usual = form.components[0]
    if is_linear(usual):
        expected, bound = result.image, 0.0 if form.exact else 0.01  # shared exponents have 8 bits
        assert kind == "float"
    else:
        expected = codes(shown_pixels(result.image, None, View().resolved())) / 255
        bound = 1e-6 if form.exact else 0.06
        assert kind == usual
    assert np.abs(colours(channels) - expected).max() <= bound


@pytest.mark.parametrize("suffix", [s for s in MADE if FORMATS[s].alpha])
def test_alpha_is_multiplied_in_where_numbers_are_radiance_and_straight_elsewhere(
    tmp_path: Path, suffix: str
) -> None:
    result, form = make_result(alpha=True), FORMATS[suffix]
    assert result.alpha is not None
    result.save(tmp_path / f"a{suffix}")
    channels, _, _ = read(tmp_path / f"a{suffix}")
    if is_linear(form.components[0]):
        np.testing.assert_array_equal(colours(channels), result.image)
        np.testing.assert_array_equal(channels["A"], result.alpha)
        return
    straight = shown_pixels(result.image, result.alpha, View().resolved())
    np.testing.assert_allclose(channels["A"], straight[..., 3], atol=0.01)
    seen = result.alpha > 0.1
    expected = codes(straight)[..., :3] / 255
    assert np.abs(colours(channels) - expected)[seen].max() < (1e-6 if form.exact else 0.12)


@pytest.mark.parametrize("suffix", [".jpg", ".hdr", ".pfm", ".ppm"])
def test_a_format_without_alpha_says_so(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(OptionError, match=rf"a {suffix} file cannot hold alpha.*\.png"):
        make_result(alpha=True).save(tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("suffix", "component"), [(s, c) for s in MADE for c in FORMATS[s].components[1:]])
def test_numbers_are_what_is_asked_for(tmp_path: Path, suffix: str, component: str) -> None:
    result = make_result()
    result.save(tmp_path / f"a{suffix}", component_format=component)
    channels, _, kind = read(tmp_path / f"a{suffix}")
    if component == "uint16":
        expected, bound = shown_pixels(result.image, None, View().resolved()), 2 / 65535
        assert kind == "uint16"
    else:
        expected, bound = result.image, 1e-3 if component == "float16" else 0.0
    assert np.abs(colours(channels) - expected).max() <= bound


def test_half_floats_are_for_colours_and_errors_keep_their_digits(tmp_path: Path) -> None:
    result = make_result(alpha=True)
    result.save(tmp_path / "a.exr", component_format="float16")
    opened = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    spec = opened.spec()
    kinds = dict(zip(spec.channelnames, map(str, spec.channelformats), strict=True))
    opened.close()
    assert {name for name, kind in kinds.items() if kind == "half"} == set("RGBA")
    channels, _, _ = read(tmp_path / "a.exr")
    np.testing.assert_array_equal(channels["lookups"], result.aovs["lookups"])
    np.testing.assert_array_equal(channels["variance.G"], result.variance[..., 1])
    np.testing.assert_array_equal(channels["R"], result.image[..., 0].astype(np.float16))


def test_what_half_floats_cannot_hold_is_cut_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    result = make_result()
    result.image[0, :3, 0] = 1e6, np.inf, np.nan
    result.save(tmp_path / "a.exr", component_format="float16")
    channels, _, _ = read(tmp_path / "a.exr")
    np.testing.assert_array_equal(channels["R"][0, :3], [65504, np.inf, np.nan])
    assert "1 values are beyond half floats" in caplog.text


@pytest.mark.parametrize(
    ("name", "component", "message"),
    [
        ("a.jpg", "float16", r"a \.jpg file cannot hold float16.*it holds uint8.*\.exr"),
        ("a.png", "float32", r"a \.png file cannot hold float32"),
        ("a.exr", "uint8", r"a \.exr file cannot hold uint8"),
        ("a.hdr", "float32", r"a \.hdr file cannot hold float32.*it holds rgbe"),
        ("a.exr", "half", r"unknown component_format 'half'.*uint8, uint16, float16, float32"),
        ("a.exr", 16, "unknown component_format 16"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(
    tmp_path: Path, name: str, component: str, message: str
) -> None:
    with pytest.raises(OptionError, match=message):
        make_result().save(tmp_path / name, component_format=component)


def test_a_size_that_a_format_cannot_have_is_refused(tmp_path: Path) -> None:
    ones = np.ones((1, 16384, 3))
    wide = Result.from_estimate(Moments(ones, ones, 1), (0, 1), {}, {}, {})
    with pytest.raises(OptionError, match="1 to 16383 pixels a side, not 16384 x 1"):
        wide.save(tmp_path / "a.webp")
    with pytest.raises(OptionError, match="at least 32 pixels a side"):
        wide.save(tmp_path / "a.jp2")
    wide.save(tmp_path / "a.tif")


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".tga", ".dpx"])
def test_metadata_goes_where_there_is_a_place(tmp_path: Path, suffix: str) -> None:
    make_result().save(tmp_path / f"a{suffix}", 1.5)
    _, attributes, _ = read(tmp_path / f"a{suffix}")
    text = str(attributes["ImageDescription"])
    assert str(attributes["Software"]).startswith("clvol 1.2.3") and text.startswith('{"technique": "delta"')
    if suffix in (".jpg", ".tif"):  # the others cut it
        about = json.loads(text)
        assert about["scene"] == "naïve.xml" and about["exposure"] == "1.5"
        assert "ACES" in about["view_transform"]


def run(folder: Path, *words: str, film: str = "") -> tuple[int, str]:
    """`clvol render` of a plain scene."""
    (folder / "scene.xml").write_text(SCENE.format(film=film))
    outcome = CliRunner().invoke(main, ["render", str(folder / "scene.xml"), "--spp", "1", *words])
    return outcome.exit_code, outcome.stdout + outcome.stderr


def test_the_command_writes_pictures_by_their_names(tmp_path: Path) -> None:
    names = [str(tmp_path / name) for name in ("a.exr", "a.jpg", "a.tif", "a.hdr")]
    words = [word for name in names for word in ("-o", name)]
    code, said = run(tmp_path, *words, "--component-format", "float16", "--view-transform", "raw")
    assert code == 0, said
    assert read(tmp_path / "a.exr")[0]["R"].dtype == np.float32
    np.testing.assert_array_equal(read(tmp_path / "a.tif")[0]["R"], 1)  # radiance 1, as it is


def test_the_scene_says_what_numbers_its_files_hold(tmp_path: Path) -> None:
    half = '<string name="component_format" value="float16"/>'
    code, said = run(tmp_path, "-o", str(tmp_path / "a.exr"), "-o", str(tmp_path / "a.png"), film=half)
    assert code == 0, said
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert str(spec.channelformats[0]) == "half"
    code, said = run(tmp_path, "-o", str(tmp_path / "a.exr"), film=half.replace("float16", "uint32"))
    assert code == 2 and "component_format" in said and "float16, float32" in said


def test_the_exposure_that_was_chosen_is_said(tmp_path: Path) -> None:
    code, said = run(tmp_path, "-o", str(tmp_path / "a.png"), "--exposure", "auto")
    assert code == 0 and "exposure +0.00 stops" in said  # radiance 1 is as bright as paper
    assert read(tmp_path / "a.png")[1]["exposure"] == "0"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--exposure", "1"], "--exposure needs a picture for a display"),
        (["--display", "p3 - display"], "--display needs a picture for a display"),
        (["--view-transform", "raw"], "--view-transform needs a picture for a display"),
        (["--component-format", "uint8"], "cannot hold uint8"),
        (["--exposure", "bright"], "a number of stops or auto, not 'bright'"),
        (["-o", "a.png", "--view-transform", "filmic"], "choose among"),
    ],
)
def test_options_that_nothing_would_use_are_refused(tmp_path: Path, words: list[str], message: str) -> None:
    code, said = run(tmp_path, "-o", str(tmp_path / "a.exr"), *words)
    assert code == 2 and message in " ".join(said.split()), said
    assert not list(tmp_path.glob("a.*"))


def test_a_format_that_this_openimageio_does_not_make_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(FORMATS, ".jxl", replace(FORMATS[".jxl"], plugin="nothing"))
    with pytest.raises(OptionError, match=r"the installed OpenImageIO makes no \.jxl files"):
        make_result().save(tmp_path / "a.jxl")
