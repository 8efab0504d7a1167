"""Scenes made of a volume alone, in Python and on the command line: the same, and ordinary ones."""

from __future__ import annotations

import inspect
import logging
import re
import shlex
import shutil
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner, Result
from places import CASES, ROOT, SCENES

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError, VolumeError
from clvol.scene.records import ConstVolume, EnvmapEmitter, GridVolume
from clvol.scene.spectra import srgb_to_linear
from clvol.staging.colours import NAMES, radiance_of
from clvol.staging.options import OPTIONS, checked
from clvol.staging.source import Source
from clvol.staging.stage import stage

if TYPE_CHECKING:
    from pathlib import Path

FIRE = SCENES / "fire.vdb"


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def ball(n: int = 24, radius: float = 0.4) -> np.ndarray:
    """A soft ball in the middle of n³ samples."""
    z, y, x = (np.indices((n, n, n)) + 0.5) / n - 0.5
    density: np.ndarray = np.clip(1 - np.sqrt(x**2 + y**2 + z**2) / radius, 0, None)
    return density.astype(np.float32)


@pytest.fixture(scope="module")
def npz(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("volume") / "smoke.npz"
    np.savez(path, density=ball(), velocity=np.ones((24, 24, 24, 3)), noise=ball())
    return path


def test_the_command_line_and_python_have_one_list_of_options() -> None:
    parameters = dict(list(inspect.signature(clvol.volume_scene).parameters.items())[1:])
    assert list(parameters) == [*OPTIONS, "size", "spp"]
    assert {parameters[name].default for name in OPTIONS} == {None}
    for command in ("render", "scene"):
        text = run(command, "--help").stdout
        for name in OPTIONS:
            assert re.search(rf"--{name.replace('_', '-')}[ ,]", text)


def test_a_file_is_a_picture_in_one_command(npz: Path, tmp_path: Path) -> None:
    outcome = run("render", npz, "-o", tmp_path / "a.exr", "--size", "20x16", "--quality", "draft")
    assert outcome.exit_code == 0, outcome.output
    lines = [line.split()[0] for line in outcome.stdout.splitlines()[:4]]
    assert lines == ["density", "up", "camera", "light"]
    picture = oiio.ImageBuf(str(tmp_path / "a.exr"))
    assert (picture.spec().width, picture.spec().height) == (20, 16)
    assert picture.spec().get_int_attribute("spp") == 8
    scene = clvol.volume_scene(npz, size=(20, 16))
    pixels = picture.get_pixels(oiio.FLOAT)[..., :3]
    np.testing.assert_array_equal(pixels, clvol.render(scene, spp=8).image)


def test_the_scene_that_is_written_is_the_one_that_is_rendered(npz: Path, tmp_path: Path) -> None:
    shutil.copy(npz, tmp_path / "smoke.npz")
    options = "--size", "16x24", "--light", "studio", "--view", "right"
    outcome = run("scene", tmp_path / "smoke.npz", "-o", tmp_path / "smoke.xml", "--spp", "2", *options)
    assert outcome.exit_code == 0, outcome.output
    assert outcome.stdout.splitlines()[-1].endswith("smoke_environment.exr: the scene")
    written = clvol.load_file(tmp_path / "smoke.xml")
    made = clvol.volume_scene(tmp_path / "smoke.npz", size=(16, 24), spp=2, light="studio", view="right")
    assert written.spp == made.spp == 2
    assert len(written.emitters) == len(made.emitters) == 4
    np.testing.assert_allclose(written.sensor.to_world, made.sensor.to_world, atol=1e-9)
    first, second = (clvol.render(scene).image for scene in (written, made))
    np.testing.assert_allclose(first, second, rtol=0.1, atol=1e-3)
    np.testing.assert_allclose(first.mean(), second.mean(), rtol=1e-3)


def test_a_floor_is_below_and_glowing_smoke_is_written_too(tmp_path: Path) -> None:
    outcome = run("scene", FIRE, "-o", tmp_path / "fire.xml", "--ground", "--background", "black")
    assert outcome.exit_code == 0, outcome.output
    written = clvol.load_file(tmp_path / "fire.xml")
    made = clvol.volume_scene(FIRE, ground=True, background="black")
    assert written.film.backdrop == (0.0,) and made.film.backdrop == (0.0,)
    for scene in (written, made):
        floor, volume = scene.shapes
        assert floor.kind == "disk" and volume.interior.emits
        np.testing.assert_allclose(floor.to_world[:3, 2] / floor.to_world[2, 2], [0, 0, 1], atol=1e-12)
        lowest = volume.interior.sigma_t.index_to_world @ [*volume.interior.sigma_t.grid.active_box[0], 1]
        assert floor.to_world[2, 3] < lowest[2]
    np.testing.assert_allclose(written.shapes[0].to_world, made.shapes[0].to_world, atol=1e-9)


def test_a_written_scene_finds_its_volume_from_its_own_folder(
    npz: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(npz.parent)
    (tmp_path / "deep").mkdir()
    outcome = run("scene", npz.name, "-o", tmp_path / "deep" / "smoke.xml", "--size", "8x8")
    assert outcome.exit_code == 0, outcome.output
    monkeypatch.chdir(tmp_path)
    assert clvol.load_file("deep/smoke.xml").shapes


def test_fire_has_flames_of_a_temperature_and_smoke_does_not() -> None:
    burning, smoke = clvol.volume_scene(FIRE), clvol.volume_scene(FIRE, flame="none", temperature="none")
    [medium] = [shape.interior for shape in burning.shapes]
    assert isinstance(medium.emission, GridVolume) and medium.emission.grid.name == "flame"
    assert isinstance(medium.temperature, GridVolume) and medium.temperature.grid.name == "temperature"
    assert 1500 < 2.992 * medium.temperature_scale < 3000  # a fire's kelvin
    assert medium.temperature_offset == 0
    assert not smoke.shapes[0].interior.emits
    assert smoke.shapes[0].interior.albedo.value > medium.albedo.value
    hot = clvol.volume_scene(FIRE, temperature_scale=1000.0, emission_scale=2.0).shapes[0].interior
    assert (hot.temperature_scale, hot.emission_scale) == (1000.0, (2.0,))
    assert not clvol.volume_scene(FIRE, emission_scale=0).shapes[0].interior.emits


def test_only_the_hottest_glows_where_there_is_no_flame() -> None:
    medium = clvol.volume_scene(FIRE, flame="none").shapes[0].interior
    assert 1 < medium.temperature_offset < 2.9
    assert 1500 < (2.992 - medium.temperature_offset) * medium.temperature_scale < 3000


def test_temperatures_that_can_be_kelvin_are() -> None:
    heat = 1500 * ball()
    scene = clvol.volume_scene({"density": ball(), "flame": ball(), "temperature": heat})
    assert scene.shapes[0].interior.temperature_scale == 1
    scene = clvol.volume_scene({"density": ball(), "temperature": heat})
    medium = scene.shapes[0].interior
    assert (heat.max() - medium.temperature_offset) * medium.temperature_scale == pytest.approx(heat.max())


def test_thickness_is_eight_whatever_the_file_s_units() -> None:
    thin, thick = (clvol.volume_scene(factor * ball()).shapes[0].interior for factor in (1e-3, 1e3))
    assert thin.scale[0] / thick.scale[0] == pytest.approx(1e6, rel=0.1)
    # Through the middle of the ball the integral is 0.4 times its scale; the 90th percentile is less.
    assert 8 < 0.4 * 1e-3 * thin.scale[0] < 16
    assert clvol.volume_scene({"sigma_t": ball()}).shapes[0].interior.scale == (1.0,)  # it is an extinction
    assert clvol.volume_scene(ball(), density_scale=5).shapes[0].interior.scale == (5.0,)


def test_arrays_have_cubic_voxels_and_keep_their_boxes(tmp_path: Path) -> None:
    scene = clvol.volume_scene(np.ones((4, 8, 16), np.float32))
    volume = scene.shapes[0].interior.sigma_t
    np.testing.assert_allclose(np.diag(volume.index_to_world)[:3], 1 / 16)
    grid = clvol.volumes.DenseGrid(ball()[..., None], np.array([[-1.0, 0, 0], [3, 2, 1]]))
    clvol.volumes.write_vol(tmp_path / "a.vol", grid.values, grid.box)
    volume = clvol.volume_scene(tmp_path / "a.vol").shapes[0].interior.sigma_t
    np.testing.assert_allclose(np.diag(volume.index_to_world)[:3] * 24, [4, 2, 1])


def test_a_colour_grid_is_the_albedo() -> None:
    colour = np.stack([ball(), 0.5 * ball(), 0.1 * ball()], axis=-1)
    medium = clvol.volume_scene({"density": ball(), "Cd": colour}).shapes[0].interior
    assert isinstance(medium.albedo, GridVolume) and medium.albedo.grid.values.shape[-1] == 3
    with pytest.raises(VolumeError, match="one channel, a colour has three; colour"):
        clvol.volume_scene({"density": ball(), "Cd": ball()})


def test_nan_is_mended_where_it_is_asked_for(caplog: pytest.LogCaptureFixture) -> None:
    broken = ball()
    broken[:2, :3] = np.nan
    with pytest.raises(VolumeError, match="NaN"):
        clvol.volume_scene(broken)
    mended = clvol.volume_scene(broken, sanitize=True).shapes[0].interior
    assert mended.scale == clvol.volume_scene(np.nan_to_num(broken)).shapes[0].interior.scale
    assert caplog.text.count("samples are taken as 0") == 1


def test_a_level_set_is_filled_with_fog() -> None:
    surface = CASES / "nvdb" / "level_set.nvdb"
    with pytest.raises(VolumeError, match="is a level set"):
        clvol.volume_scene(surface)
    volume = clvol.volume_scene(surface, level_set="fog").shapes[0].interior.sigma_t
    assert volume.grid.leaf_values.max() == 1


def test_a_grid_that_was_loaded_is_taken_as_it_is() -> None:
    grid = clvol.load_volume(FIRE)
    scene = clvol.volume_scene({"density": grid}, up="z")
    expected = clvol.volume_scene(FIRE, flame="none", temperature="none")
    np.testing.assert_array_equal(scene.sensor.to_world, expected.sensor.to_world)
    assert scene.shapes[0].interior.sigma_t.grid is grid


def test_an_empty_volume_is_an_empty_picture() -> None:
    scene = clvol.volume_scene(np.zeros((4, 4, 4)))
    image = clvol.render(scene, spp=1, size=(8, 8)).image
    assert np.isfinite(image).all() and (image > 0).all()  # the sky


def test_what_was_chosen_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "clvol"):
        clvol.volume_scene(FIRE)
    for text in ("grid density times", "grid flame times", "z: Blender", "three-quarter", "rim: two lights"):
        assert text in caplog.text


def test_the_light_is_an_environment_s_file(tmp_path: Path) -> None:
    sky = oiio.ImageBuf(oiio.ImageSpec(8, 4, 3, oiio.FLOAT))
    assert sky.write(str(tmp_path / "sky.exr"))
    scene = clvol.volume_scene(ball(), light=str(tmp_path / "sky.exr"))
    [light] = scene.emitters
    assert isinstance(light, EnvmapEmitter) and light.source.endswith("sky.exr")


def test_the_sun_stands_where_it_is_told_to() -> None:
    scene = clvol.volume_scene(ball(), sun_direction=(0, 3, 4))
    np.testing.assert_allclose(scene.emitters[1].direction, [0, -0.6, -0.8])


@pytest.mark.parametrize(
    ("given", "unused"),
    [
        ({"light": "sky", "sun_direction": (0, 3, 4)}, "unused   the sun's direction"),
        ({"temperature_scale": 100.0}, "unused   the temperature's scale: nothing glows"),
        ({"emission_scale": 5.0}, "unused   the emission's scale: nothing glows"),
    ],
)
def test_what_changes_nothing_is_said(given: dict[str, object], unused: str) -> None:
    assert any(line.startswith(unused) for line in stage(Source.of(ball()), given).lines)
    assert not any(line.startswith("unused") for line in stage(Source.of(ball()), {}).lines)


def test_a_density_of_0_is_told_from_one_that_is_not_met(caplog: pytest.LogCaptureFixture) -> None:
    scene = clvol.volume_scene(ball(), transfer={"opacity": [(100, 0), (200, 2)]})
    clvol.render(scene, spp=1, size=(8, 8))
    assert "no path met any density: it is 0 everywhere" in caplog.text


def test_a_density_that_is_met_without_a_look_up_is_met(caplog: pytest.LogCaptureFixture) -> None:
    """A control that is all of the density."""
    fog = {
        "type": "heterogeneous",
        "sigma_t": {"type": "gridvolume", "grid": np.ones((4, 4, 4))},
        "albedo": 1.0,
    }
    cube = {"type": "cube", "bsdf": {"type": "null"}, "interior": fog}
    scene = {"type": "scene", "sensor": {"type": "perspective"}, "sky": {"type": "constant"}, "fog": cube}
    result = clvol.render(clvol.load_dict(scene), spp=4, size=(8, 8), technique="weighted-decomposition")
    assert result.stats["lookups"] == 0 and "no path met" not in caplog.text


def test_what_is_behind_has_any_colour_or_none() -> None:
    film = clvol.volume_scene(ball(), background="#ff8000").film
    np.testing.assert_allclose(film.backdrop, [1, 0.2158605, 0], atol=1e-6)
    assert clvol.volume_scene(ball(), background=0.25).film.backdrop == (0.25,)
    clear = clvol.volume_scene(ball(), background="transparent")
    assert clvol.volume_scene(ball(), background="black").film.backdrop == (0.0,)
    assert clear.film.has_alpha and clear.integrator.hide_emitters
    for name in ("red", "RED", "#f00", "#FF0000"):
        assert clvol.volume_scene(ball(), background=name).film.backdrop == (1.0, 0.0, 0.0)
    with pytest.raises(OptionError, match=r"did you mean 'orange'.*names are black, grey"):
        clvol.volume_scene(ball(), background="ornage")


@pytest.mark.parametrize("name", [*NAMES, "gray", "aqua", "fuchsia"])
def test_colours_are_those_of_css(name: str) -> None:
    colors = pytest.importorskip("matplotlib.colors", reason="the extra 'science' is not installed")
    other = {"grey": "gray"}.get(name, name)
    np.testing.assert_allclose(
        np.broadcast_to(radiance_of(name), 3), srgb_to_linear(np.float32(colors.to_rgb(other))), atol=1e-6
    )


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("albedo", 1.5),
        ("albedo", (0.1, 0.2)),
        ("anisotropy", 1),
        ("density_scale", 0),
        ("density_scale", float("nan")),
        ("view", "below"),
        ("light", "moon"),
        ("light", "missing.exr"),
        ("up", "x"),
        ("elevation", 91),
        ("sun_direction", (0, 0, 0)),
        ("background", "#12"),
        ("ground", 3),
        ("distance", "far"),
        ("density", 3),
        ("emission_scale", True),
        *((name, np.zeros(2)) for name in ("view", "up", "light", "level_set", "background")),
    ],
)
def test_values_that_will_not_do_are_refused(option: str, value: object) -> None:
    with pytest.raises(OptionError, match=option):
        checked({option: value})


def test_mistakes_are_told(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="view and azimuth"):
        checked({"view": "front", "azimuth": 3.0})
    with pytest.raises(TypeError, match="did you mean 'albedo'"):
        stage(Source.of(ball()), {"albdo": 1})
    with pytest.raises(VolumeError, match="axes"):
        clvol.volume_scene(np.ones((3, 3)))
    with pytest.raises(VolumeError, match="negative"):
        clvol.volume_scene(ball() - 0.5)
    with pytest.raises(OptionError, match="by their names"):
        clvol.volume_scene({})
    with pytest.raises(VolumeError, match="no such file"):
        clvol.volume_scene(tmp_path / "missing.vdb")


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (["render", FIRE, "-o", "a.png", "-D", "res=2"], "-D fills a scene"),
        (["render", FIRE, "-o", "a.png", "--sensor", "1"], "--sensor"),
        (["render", FIRE, "-o", "a.png", "--quality", "best"], "draft, good, final"),
        (["render", FIRE, "-o", "a.png", "--quality", "good", "--target-error", "0.1"], "--quality or"),
        (["render", FIRE, "-o", "a.png", "--view", "below"], "unknown --view 'below'"),
        (["render", FIRE, "-o", "a.png", "--size", "640"], "640x480"),
        (["render", SCENES / "fire.xml", "-o", "a.png", "--light", "sun"], "--light is for volumes"),
        (["render", "missing.vdb", "-o", "a.png"], "missing.vdb"),
        (["scene", FIRE, "-o", "fire.vdb"], ".xml"),
        (
            ["scene", SCENES / "slab.xml", "-o", "other.xml"],
            "is a scene already, not a volume; `clvol render`",
        ),
        (["scene", "cloud.pbrt", "-o", "other.xml"], "cloud.pbrt' does not exist"),
        (["scene", SCENES / "fire.xml", "-o", "a.xml"], "fire.xml"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str | Path], fragment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run(*arguments)
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1
    assert fragment in outcome.stderr
    assert not list(tmp_path.iterdir())


def test_background_is_still_a_choice_of_the_renderer(npz: Path, tmp_path: Path) -> None:
    outcome = run(
        "render", npz, "-o", tmp_path / "a.exr", "--size", "8x8", "--spp", "1", "--background", "sampled"
    )
    assert outcome.exit_code == 0, outcome.output
    spec = oiio.ImageBuf(str(tmp_path / "a.exr")).spec()
    assert spec.get_string_attribute("background") == "sampled"
    assert isinstance(clvol.volume_scene(npz).shapes[0].interior.albedo, ConstVolume)


@pytest.mark.contract
def test_the_commands_that_begin_the_documentation_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "getting-started.md").read_text(encoding="utf-8")
    commands = re.findall(r"^clvol ((?:render|scene) scenes/fire.vdb .*)$", text, re.MULTILINE)
    assert len(commands) >= 3
    (tmp_path / "scenes").symlink_to(SCENES, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    for command in commands:
        words = shlex.split(command)
        if "--denoise" in words:
            pytest.importorskip("pyoidn", reason="the extra 'denoise' is not installed")
        outcome = run(*words, "--size", "16x16", *([] if "--quality" in words else ["--spp", "1"]))
        assert outcome.exit_code == 0, outcome.output
        assert (tmp_path / words[words.index("-o") + 1]).is_file()
