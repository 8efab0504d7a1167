"""All that is wrong with a scene is told at once; what is not supported can be left out."""

import logging
import subprocess
import sys

import pytest
from click.testing import CliRunner

import clvol
from clvol.cli.main import main
from clvol.scene.faults import MOST

CAMERA = '<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="2"/>\
<integer name="height" value="2"/></film></sensor>'
SKY = '<emitter type="constant"/>'


def scene(*lines):
    return "\n".join(['<scene version="3.0.0">', CAMERA, SKY, *lines, "</scene>"])


UNSUPPORTED = (
    '<shape type="cube"><bsdf type="velvet"/></shape>',
    '<shape type="teapot"/>',
    '<shape type="sphere"><float name="radius" value="0.5"/><float name="radios" value="2"/></shape>',
)


def error_of(text):
    with pytest.raises(clvol.SceneError) as caught:
        clvol.load_string(text)
    return str(caught.value)


def test_all_faults_are_in_one_error_in_order_of_their_lines():
    lines = (
        *UNSUPPORTED,
        '<shape type="obj"><string name="filename" value="nowhere.obj"/></shape>',
        '<shape type="ply"><string name="filename" value="nowhere.ply"/></shape>',
        '<shape type="sphere"><float name="radius" value="-1"/><float name="center" value="0"/></shape>',
        '<shape type="disk"><float name="x" value="1,2"/></shape>',
    )
    head, *told, hint = error_of(scene(*lines)).split("\n")
    assert head == "8 faults in the scene:"
    found = [
        "the text:4: unknown bsdf 'velvet'",
        "the text:5: unknown shape 'teapot'",
        "the text:6: unknown parameter 'radios' of shape 'sphere'; did you mean 'radius'?",
        "the text:7: file 'nowhere.obj' does not exist",
        "the text:8: file 'nowhere.ply' does not exist",
        "the text:9: 'center' of shape 'sphere' must be three finite numbers",
        "the text:9: 'radius' of shape 'sphere' must be finite and > 0",
        "the text:10: '1,2' is not a number",
    ]
    assert len(told) == len(found)
    for line, start in zip(told, found, strict=True):
        assert line.startswith(f"  {start}")
    assert hint == "with clvol.skip_unsupported(): loads the scene without the 3 that are not supported"


def test_one_fault_is_told_as_ever():
    assert error_of(scene(UNSUPPORTED[1])).startswith("the text:4: unknown shape 'teapot'; supported: cube")


def test_what_follows_from_a_fault_is_no_fault():
    """A ref to what could not be read, a mixture of one, no sensor where there is one that is unknown."""
    lines = (
        '<bsdf id="a" typ="diffuse"/>',
        '<shape type="cube"><ref id="a"/></shape>',
        '<medium id="m" type="homogeneous"><phase type="blendphase"><float name="weight" value="0.5"/>'
        '<phase type="hg"/><phase type="snow"/></phase></medium>',
    )
    text = scene(*lines).replace("perspective", "fisheye")
    told = error_of(text).split("\n")
    assert [line.split(": ")[0].strip() for line in told[1:-1]] == [f"the text:{n}" for n in (2, 4, 6)]
    lost_include = ('<include filename="nowhere.xml"/>', '<shape type="cube"><ref id="a"/></shape>')
    assert error_of(scene(*lost_include)).startswith("the text:4: file 'nowhere.xml' does not exist")


def test_there_is_an_end_to_faults():
    error = error_of(scene(*(f'<shape type="a{n}"/>' for n in range(10 * MOST))))
    assert error.startswith(f"{MOST} or more faults")
    many = "".join(f'<float name="a{n}" value="1"/>' for n in range(10 * MOST))
    assert error_of(scene(f'<shape type="cube">{many}</shape>')).startswith(f"{MOST} or more faults")
    nested = (
        '<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="twosided" id="b"><ref id="a"/></bsdf>'
    )
    assert "nested without end" in error_of(scene(nested))


def test_what_is_not_supported_can_be_left_out(caplog):
    medium = '<medium type="heterogeneous" name="interior"><volume name="sigma_t" type="fog"/></medium>'
    lines = (*UNSUPPORTED, f'<shape type="cube"><bsdf type="null"/>{medium}</shape>')
    with caplog.at_level(logging.WARNING, "clvol"), clvol.skip_unsupported():
        loaded = clvol.load_string(scene(*lines))
    assert [shape.kind for shape in loaded.shapes] == ["cube", "sphere", "cube"]
    assert loaded.shapes[0].bsdf.reflectance == (0.5,)
    assert loaded.shapes[1].to_world[0, 0] == 0.5
    assert loaded.shapes[2].interior is None
    assert loaded.left_out == (
        "the text:4: unknown bsdf 'velvet'",
        "the text:5: unknown shape 'teapot'",
        "the text:6: unknown parameter 'radios' of shape 'sphere'",
        "the text:7: unknown volume 'fog'",
        "the text:7: medium 'heterogeneous' is left out with it",
    )
    assert [record.getMessage() for record in caplog.records] == [f"left out: {s}" for s in loaded.left_out]
    assert clvol.render(loaded, spp=1).metadata["left_out"] == "; ".join(loaded.left_out)
    assert "teapot" in error_of(scene(*lines))  # outside of the with


def test_mistakes_and_missing_files_cannot_be_left_out():
    missing = '<shape type="obj"><string name="filename" value="nowhere.obj"/></shape>'
    for fault in (missing, '<shape type="sphere"><float name="radius" value="-1"/></shape>'):
        with clvol.skip_unsupported():
            assert error_of(scene(UNSUPPORTED[1], fault)).startswith("the text:5: ")


def test_the_command_line_lists_faults_and_leaves_out(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(scene(*UNSUPPORTED))
    command = [
        sys.executable,
        "-m",
        "clvol",
        "render",
        str(path),
        "-o",
        str(tmp_path / "a.exr"),
        "--spp",
        "1",
    ]
    refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    lines = refused.stderr.strip().split("\n")
    assert lines[0] == "clvol: error: 3 faults in the scene:"
    assert lines[-1] == "--skip-unsupported renders without these"
    done = subprocess.run([*command, "--skip-unsupported"], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr.count("left out: ") == 3
    assert clvol.load_result(tmp_path / "a.exr").metadata["left_out"].count("unknown") == 3


def test_info_lists_what_would_be_refused_and_what_is_taken_as_something_else(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(scene(*UNSUPPORTED).replace("<film", '<sampler type="halton"/><film'))
    told = CliRunner().invoke(main, ["info", str(path)])
    assert told.exit_code == 0
    assert told.stdout.count("\nrefused  ") == 3
    assert f"refused  {path}:5: unknown shape 'teapot'" in told.stdout
    assert "taken    sampler 'halton' is taken as clvol's own sampler" in told.stdout
    assert str(clvol.info(path)) == told.stdout.strip("\n")
