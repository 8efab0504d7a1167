"""No picture, report or scene that clvol writes takes the place of a file that the scene is read from."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner

import clvol
from clvol.cli.main import main
from clvol.picture.image_io import encode_exr, split_channels
from clvol.volumes.vol import write_vol

if TYPE_CHECKING:
    from pathlib import Path

SCENE = """<scene version="3.0.0">
  <default name="sky" value="sky.exr"/>
  <include filename="view.xml"/>
  <emitter type="envmap"><string name="filename" value="$sky"/></emitter>
  <shape type="obj"><string name="filename" value="floor.obj"/>
    <bsdf type="diffuse"><texture name="reflectance" type="bitmap">
      <string name="filename" value="wood.exr"/></texture></bsdf></shape>
  <shape type="cube"><bsdf type="null"/>
    <medium name="interior" type="heterogeneous">
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="fog.vol"/></volume>
    </medium></shape>
</scene>"""
VIEW = """<scene version="3.0.0">
  <sensor type="perspective">
    <transform name="to_world"><lookat origin="0, 0, -4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/></film>
    <sampler type="independent"><integer name="sample_count" value="1"/></sampler>
  </sensor>
</scene>"""
OBJ = "v -2 -2 -2\nv 2 -2 -2\nv 0 -2 2\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
COMPARED = "--techniques", "delta,regular", "-o", "report"
FILES = {"scene.xml", "view.xml", "sky.exr", "floor.obj", "wood.exr", "fog.vol"}


def refused(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 2, done.output
    [line] = done.stderr.splitlines()
    return line


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene that includes another file, and names a mesh, a texture, an environment and a volume."""
    grey = encode_exr(split_channels("", np.full((4, 4, 3), 0.5, np.float32)), {})
    for name, data in {"scene.xml": SCENE, "view.xml": VIEW, "floor.obj": OBJ}.items():
        (tmp_path / name).write_text(data)
    for name in ("sky.exr", "wood.exr"):
        (tmp_path / name).write_bytes(grey)
    write_vol(tmp_path / "fog.vol", np.ones((2, 2, 2, 1), np.float32), np.array([[0.0] * 3, [1.0] * 3]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_scene_knows_every_file_it_was_read_from(folder: Path) -> None:
    scene = clvol.load_file("scene.xml")
    assert set(scene.files) == FILES and scene.files[0] == "scene.xml"
    assert "fog.vol" in str(clvol.info(scene))
    assert set(clvol.load_string(SCENE).files) == FILES - {"scene.xml"}
    loaded = clvol.load_volume("fog.vol")
    assert clvol.volume_scene(loaded).files == clvol.volume_scene("fog.vol").files == ("fog.vol",)


def test_files_that_other_files_name_are_known_too(folder: Path) -> None:
    pytest.importorskip("SimpleITK", reason="the extra 'science' is not installed")
    np.ones((2, 2, 2), np.float32).tofile(folder / "scan.raw")
    header = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_FLOAT\nElementDataFile = scan.raw\n"
    (folder / "scan.mhd").write_text(header)
    assert set(clvol.volume_scene("scan.mhd").files) == {"scan.mhd", "scan.raw"}


@pytest.mark.parametrize(
    "arguments",
    [
        ("render", "scene.xml", "-o", "sky.exr"),
        ("render", "scene.xml", "-o", "a.png", "-o", "wood.exr"),
        ("render", "scene.xml", "-o", "a.png", "--trace", "link.json"),
        ("ray", "scene.xml", "2", "2", "-o", "link.json"),
        ("compare", "scene.xml", "-D", "sky=report/reference.exr", *COMPARED),
    ],
)
def test_commands_replace_no_file_of_the_scene(
    arguments: tuple[str, ...], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the links to it, and before anything is rendered."""
    for name in ("render", "compare", "trace_ray"):
        monkeypatch.setattr(clvol, name, None)
    (folder / "link.json").symlink_to("fog.vol")
    (folder / "report").mkdir()
    shutil.copy("sky.exr", "report/reference.exr")
    (folder / "report" / "report.json").write_text('{"kind": "clvol compare", "files": ["reference.exr"]}')
    before = {name: (folder / name).read_bytes() for name in FILES}
    assert "scene" in refused(*arguments)
    assert {name: (folder / name).read_bytes() for name in FILES} == before
    assert not (folder / "a.png").exists()


def test_results_replace_no_file_of_their_scene(folder: Path) -> None:
    """Nor do those that come from files, nor the frames of a turntable and what is made of a volume."""
    result = clvol.render(clvol.load_file("scene.xml"))
    with pytest.raises(clvol.OptionError, match=r"sky\.exr: would replace a file of the scene"):
        result.save("sky.exr")
    result.save("a.exr")
    assert set(clvol.load_result("a.exr").files) == FILES
    assert "wood.exr: would replace" in refused("merge", "a.exr", "-o", "b.png", "-o", "wood.exr")
    assert not (folder / "b.png").exists()
    (folder / "fog_environment.exr").symlink_to("fog.vol")
    assert "fog_environment.exr: " in refused("scene", "fog.vol", "-o", "fog.xml", "--overwrite")
    assert not (folder / "fog.xml").exists()


def test_a_scene_does_not_replace_what_lies_beside_it(folder: Path) -> None:
    """Nor a scene of that name, but itself and the light that it had before; --overwrite says otherwise."""
    runner = CliRunner()
    command = ["scene", "fog.vol", "-o", "a.xml", "--light"]
    assert runner.invoke(main, [*command, "sun"]).exit_code == 0
    assert runner.invoke(main, [*command, "sun"]).exit_code == 0, "the same again"
    light, text = (folder / "a_environment.exr").read_bytes(), (folder / "a.xml").read_text()
    assert "a.xml: is there already" in refused(*command, "sun", "--spp", "3")
    assert "a_environment.exr: is there already" in refused(*command, "studio")
    assert (folder / "a_environment.exr").read_bytes() == light and (folder / "a.xml").read_text() == text
    done = runner.invoke(main, [*command, "studio", "--overwrite"])
    assert done.exit_code == 0 and "a_environment.exr" in done.output
    assert (folder / "a_environment.exr").read_bytes() != light
    edited = text.replace("<scene", "<!-- mine --><scene")
    (folder / "a.xml").write_text(edited)
    assert "or was edited; give the scene another name, or --overwrite" in refused(*command, "studio")
    assert (folder / "a.xml").read_text() == edited
