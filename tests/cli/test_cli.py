"""The command line: pictures out, one line per mistake, and nothing lost on Ctrl-C."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
from click.testing import CliRunner, Result
from places import SCENES

import clvol
from clvol.base.progress import Progress, RichProgress
from clvol.cli.main import main
from clvol.picture.estimate import Moments
from clvol.picture.result import Result as Picture
from clvol.planning.registry import FAMILIES, automatic, option

SCENE = """<scene version="3.0.0">
  <default name="res" value="8"/>
  <integrator type="volpath"/>
  <sensor type="perspective">
    <transform name="to_world"><lookat origin="0, 0, -4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="$res"/> <integer name="height" value="6"/> <rfilter type="box"/>
    </film>
    <sampler type="independent"><integer name="sample_count" value="3"/></sampler>
  </sensor>
  <emitter type="constant"/>
  <shape type="cube">
    <bsdf type="null"/>
    <medium name="interior" type="homogeneous"/>
  </shape>
</scene>
"""


@pytest.fixture
def scene(tmp_path: Path) -> str:
    """A small scene: a homogeneous cube under a white sky, 8 x 6 pixels, 3 samples."""
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return str(path)


def run(*arguments: str | Path) -> Result:
    """Run clvol with these arguments, in this process."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def assert_one_line_error(outcome: Result, *fragments: str) -> None:
    """The mistake is told in one line on standard error that holds the fragments; status 2; no traceback."""
    assert outcome.exit_code == 2, outcome.output
    lines = outcome.stderr.splitlines()
    assert len(lines) == 1, outcome.stderr
    assert lines[0].startswith("clvol: error: ")
    for fragment in fragments:
        assert fragment in lines[0]
    assert outcome.stdout == ""


# --- help ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [["--help"], []])
def test_help_lists_the_commands_with_examples(arguments: list[str]) -> None:
    outcome = run(*arguments)
    assert outcome.exit_code == 0
    for text in ("render", "info", "devices", "clvol render scenes/fire.xml -o fire.exr"):
        assert text in outcome.stdout


def test_render_help_reads_its_choices_from_the_registry() -> None:
    text = "".join(run("render", "--help").stdout.split())
    for family, entries in FAMILIES.items():
        assert f"{option(family)}[{'|'.join([*automatic(family), *entries])}]" in text
        for choice in entries.values():
            assert "".join(choice.summary.split()) in text


def test_help_imports_neither_opencl_nor_openimageio() -> None:
    program = (
        "import sys; from clvol.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'pyopencl', 'OpenImageIO', 'trimesh', 'scipy'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    finished = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr


# --- mistakes --------------------------------------------------------------------------------------


def test_missing_scene_is_one_line(tmp_path: Path) -> None:
    outcome = run("render", tmp_path / "missing.xml", "-o", tmp_path / "a.exr")
    assert_one_line_error(outcome, "missing.xml")


@pytest.mark.parametrize("name", ["technique", "transmittance", "majorant", "lookup", "absorption"])
def test_unknown_choice_names_the_known_ones(scene: str, tmp_path: Path, name: str) -> None:
    outcome = run("render", scene, "-o", tmp_path / "a.exr", f"--{name}", "magic")
    assert_one_line_error(outcome, f"unknown {name} 'magic'", "choose one of auto, ")


@pytest.mark.parametrize("definition", ["res", "=3", "9a=1", ""])
def test_bad_definition_is_one_line(scene: str, tmp_path: Path, definition: str) -> None:
    outcome = run("render", scene, "-o", tmp_path / "a.exr", "-D", definition)
    assert_one_line_error(outcome, "-D takes name=value", f"'{definition}'")


@pytest.mark.parametrize(
    ("options", "fragment"),
    [
        (["--spp", "0"], "--spp"),
        (["--spp", "many"], "--spp"),
        (["--time", "0"], "--time"),
        (["--time", "nan"], "finite"),
        (["--spp", "4", "--time", "1"], "--spp or --time"),
        (["--seed", "-1"], "--seed"),
        (["--speed"], "--speed"),
    ],
)
def test_bad_option_is_one_line_that_points_to_the_help(
    scene: str, tmp_path: Path, options: list[str], fragment: str
) -> None:
    outcome = run("render", scene, "-o", tmp_path / "a.exr", *options)
    assert_one_line_error(outcome, fragment, "see clvol render --help")


def test_missing_output_and_unknown_command_are_one_line(scene: str) -> None:
    assert_one_line_error(run("render", scene), "--output")
    assert_one_line_error(run("draw"), "'draw'")


@pytest.mark.parametrize(("name", "fragment"), [("a.gif", ".gif"), ("missing/a.exr", "no such folder")])
def test_unwritable_picture_is_refused_before_rendering(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, fragment: str
) -> None:
    monkeypatch.setattr(clvol, "render", lambda *_, **__: pytest.fail("rendered"))
    assert_one_line_error(run("render", scene, "-o", tmp_path / name), fragment)


def test_unknown_device_is_one_line(scene: str, tmp_path: Path) -> None:
    outcome = run("render", scene, "-o", tmp_path / "a.exr", "--device", "no such device")
    assert_one_line_error(outcome, "no such device")


def test_unknown_plugin_names_file_and_line(scene: str, tmp_path: Path) -> None:
    Path(scene).write_text(SCENE.replace('"homogeneous"', '"sponge"'))
    outcome = run("render", scene, "-o", tmp_path / "a.exr")
    assert_one_line_error(outcome, "sponge", "scene.xml:14")


# --- pictures --------------------------------------------------------------------------------------


def test_render_writes_every_picture_and_a_summary(scene: str, tmp_path: Path) -> None:
    exr, png = tmp_path / "a.exr", tmp_path / "a.png"
    outcome = run("render", scene, "-o", exr, "-o", png, "-D", "res=10", "--seed", "5")
    assert outcome.exit_code == 0, outcome.output
    spec = oiio.ImageInput.open(str(exr)).spec()
    assert (spec.width, spec.height) == (10, 6)
    assert spec.get_int_attribute("spp") == 3 and spec.get_int_attribute("seed") == 5
    assert png.exists()
    for text in ("a.exr", "10 x 6 pixels, 3 spp", "samples/s", "noise", "technique ", "look-ups per sample"):
        assert text in outcome.stdout
    assert outcome.stderr == ""


def test_a_part_of_the_samples_says_which_and_is_what_python_renders(scene: str, tmp_path: Path) -> None:
    outcome = run("render", scene, "-o", tmp_path / "a.exr", "--samples", "4,2", "--quiet")
    assert outcome.exit_code == 0, outcome.output
    opened = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    assert opened.spec().getattribute("samples") == "[4, 2]" and opened.spec().getattribute("spp") == 2
    part = clvol.render(clvol.load_file(scene), samples=(4, 2))
    np.testing.assert_array_equal(opened.read_image(0, 0, 0, 3, oiio.FLOAT), part.image)
    assert part.metadata["samples"] == (4, 2)
    for options in (["--samples", "4"], ["--samples", "4,2,1"], ["--samples", "4,2", "--spp", "3"]):
        assert_one_line_error(run("render", scene, "-o", tmp_path / "a.exr", *options), "samples")


def test_verbose_prints_the_plan_and_quiet_prints_nothing(scene: str, tmp_path: Path) -> None:
    verbose = run("render", scene, "-o", tmp_path / "a.exr", "-v")
    assert verbose.exit_code == 0
    assert "features" in verbose.stderr.lower() and "seconds" in verbose.stderr.lower()
    assert "generate              GENERATE   INTERSECT, IDLE" in verbose.stderr
    quiet = run("render", scene, "-o", tmp_path / "a.exr", "--quiet")
    assert (quiet.exit_code, quiet.output) == (0, "")
    assert not logging.getLogger("clvol").handlers


def test_time_limit_ends_the_render(scene: str, tmp_path: Path) -> None:
    """Nothing else ends it."""
    outcome = run("render", scene, "-o", tmp_path / "a.exr", "--time", "0.5")
    assert outcome.exit_code == 0, outcome.output
    assert oiio.ImageInput.open(str(tmp_path / "a.exr")).spec().get_int_attribute("spp") > 3


def picture(interrupted: bool) -> Picture:
    """What `clvol.render` would return, without rendering."""
    values = np.full((6, 8, 3), 0.5)
    about = {
        "technique": "delta",
        "transmittance": "ratio",
        "majorant": "grid",
        "lookup": "exact",
        "seconds": 1.0,
    }
    stats = {"interrupted": interrupted, "paths": 96, "lookups": 192}
    return Picture.from_estimate(Moments(2 * values, 2 * values**2, 2), (0, 2), {}, stats, about)


def test_interrupted_render_saves_what_it_has_and_says_so(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clvol, "render", lambda *_, **__: picture(interrupted=True))
    outcome = run("render", scene, "-o", tmp_path / "a.exr")
    assert outcome.exit_code == 130
    assert "interrupted after 2 spp" in outcome.stderr
    assert (tmp_path / "a.exr").exists()


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_a_real_render_and_keeps_the_picture(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    presses = []

    def press_once(_bar: RichProgress, _record: Progress) -> None:
        if not presses:
            presses.append(signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(RichProgress, "__call__", press_once)
    outcome = run("render", scene, "-o", tmp_path / "a.exr", "--time", "120")
    assert outcome.exit_code == 130, outcome.output
    assert "interrupted after" in outcome.stderr and "Traceback" not in outcome.stderr
    assert oiio.ImageInput.open(str(tmp_path / "a.exr")).spec().get_int_attribute("spp") >= 1


def test_options_reach_render_unchanged(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, object] = {}

    def render(loaded: object, **options: object) -> Picture:
        seen.update(options)
        options["progress"](Progress(samples_done=1, samples_total=2, seconds=0.5))
        return picture(interrupted=False)

    monkeypatch.setattr(clvol, "render", render)
    options = ["--time", "2", "--seed", "7", "--device", "pocl", "--majorant", "grid", "--technique", "delta"]
    options += ["--probability", "history", "--majorant-scale", "1.25", "--aov", "cells", "--aov", "null"]
    options += ["--size", "64x48", "--sensor", "0"]
    outcome = run("render", scene, "-o", tmp_path / "a.exr", *options)
    assert outcome.exit_code == 0, outcome.output
    del seen["progress"]
    assert seen == {
        "client": None,
        "profile": False,
        "denoise": False,
        "sensor": 0,
        "size": (64, 48),
        "spp": None,
        "samples": None,
        "time_limit": 2.0,
        "resume": None,
        "checkpoint": None,
        "checkpoint_every": 60.0,
        "target_error": None,
        "seed": 7,
        "device": "pocl",
        "technique": "delta",
        "transmittance": "auto",
        "majorant": "grid",
        "lookup": "auto",
        "absorption": "auto",
        "gathering": "auto",
        "roulette": "auto",
        "background": "auto",
        "probability": "history",
        "control": "auto",
        "sampler": "auto",
        "shadow_cache": "auto",
        "light_choice": "auto",
        "next_event": "auto",
        "lamp_edges": "auto",
        "lanes": "auto",
        "majorant_scale": 1.25,
        "step": None,
        "aov": ("cells", "null"),
    }


# --- info, devices ---------------------------------------------------------------------------------


def test_info_describes_a_scene(scene: str) -> None:
    outcome = run("info", scene, "-D", "res=12")
    assert outcome.exit_code == 0, outcome.output
    for text in (
        "12 x 6 pixels, box filter, 3 spp",
        "homogeneous medium",
        "constant, radiance 1",
        "(0, 0, -4)",
    ):
        assert text in outcome.stdout


def test_info_says_what_a_render_would_do_and_compile(scene: str) -> None:
    outcome = run("info", scene, "-D", "res=12", "--technique", "delta")
    assert outcome.exit_code == 0, outcome.output
    for text in (
        "technique      analytic               closed forms: all media are homogeneous",
        "medium_sample         MEDIUM     SHADE",
        "note: --technique delta is not used: the scene's media need only the analytic rule",
    ):
        assert text in outcome.stdout


def test_info_describes_a_scene_that_asks_for_what_cannot_be_right(scene: str, tmp_path: Path) -> None:
    """Its own choice is noted, and one on the command line is refused."""
    path = tmp_path / "impossible.xml"
    integrator, point = '<integrator type="volpath"/>', '<emitter type="point"/>'
    text = Path(scene).read_text(encoding="utf-8").replace(integrator, integrator + point)
    path.write_text(text, encoding="utf-8")
    assert_one_line_error(run("info", path, "--transmittance", "none"), "point, spot and directional")
    own = '<integrator type="volpath"><string name="transmittance" value="none"/></integrator>'
    path.write_text(text.replace(integrator, own), encoding="utf-8")
    outcome = run("info", path)
    assert outcome.exit_code == 0, outcome.output
    assert "homogeneous medium" in outcome.stdout
    assert "note: cannot be rendered as it is: transmittance 'none'" in outcome.stdout


def test_info_takes_no_choices_for_a_volume() -> None:
    assert_one_line_error(run("info", SCENES / "cloud.vol", "--technique", "delta"), "--technique")


def test_info_describes_a_dense_volume() -> None:
    cloud = SCENES / "cloud.vol"
    outcome = run("info", cloud)
    assert outcome.exit_code == 0, outcome.output
    for text in ("128 x 128 x 128 samples, 1 channel", "(0, 0, 0) to (1, 1, 1)", "0 to 1", "8 MiB"):
        assert text in outcome.stdout


def test_info_describes_every_grid_of_a_vdb() -> None:
    fire = SCENES / "fire.vdb"
    outcome = run("info", fire)
    assert outcome.exit_code == 0, outcome.output
    for text in ("density: ", "(5, 3, 7) to (75, 74, 125)", "290,395 voxels", "flame: ", "temperature: "):
        assert text in outcome.stdout
    assert "69093.68" in outcome.stdout


@pytest.mark.parametrize("name", ["missing.vdb", "missing.vol", "missing.xml", "missing.txt"])
def test_info_of_a_missing_file_is_one_line(tmp_path: Path, name: str) -> None:
    assert_one_line_error(run("info", tmp_path / name), name)


def test_info_of_a_broken_volume_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "broken.vdb").write_bytes(os.urandom(100))
    assert_one_line_error(run("info", tmp_path / "broken.vdb"), "broken.vdb")


def test_no_device_is_an_error_in_the_list_of_devices_too(monkeypatch: pytest.MonkeyPatch) -> None:
    from clvol.device import device

    monkeypatch.setattr(device, "_found", lambda: device._Drivers([], []))
    assert_one_line_error(run("devices"), "no OpenCL device found", "install")


def test_devices_lists_each_with_its_platform() -> None:
    outcome = run("devices")
    assert outcome.exit_code == 0, outcome.output
    assert outcome.stdout.startswith("0: ")
    assert "compute units" in outcome.stdout


def test_a_picture_replaces_neither_the_scene_nor_another_picture(scene: str, tmp_path: Path) -> None:
    link, before = tmp_path / "link.exr", Path(scene).read_text()
    link.symlink_to(scene)
    assert_one_line_error(run("render", scene, "-o", link), "would replace the scene")
    assert Path(scene).read_text() == before
    outputs = "-o", tmp_path / "a.exr", "-o", tmp_path / "." / "a.exr"
    assert_one_line_error(run("render", scene, *outputs), "would replace another picture")
