"""`clvol merge` and `clvol render --resume`: pictures of parts of the samples become the picture of all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner
from places import SCENES

import clvol
from clvol.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

SCENE, VOLUME = str(SCENES / "slab.xml"), str(SCENES / "cloud.vol")


def run(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    return done.output


def refused(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 2, done.output
    return done.output


def render(output: Path, *options: object) -> str:
    return run("render", SCENE, "-D", "res=8", "--sampler", "joint", "-o", output, *options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """a.exr and b.exr have parts of the samples, whole.exr has all."""
    folder = tmp_path_factory.mktemp("merge")
    render(folder / "a.exr", "--samples", "0,8")
    render(folder / "b.exr", "--samples", "8,24")
    render(folder / "whole.exr", "--spp", 32)
    return folder


def assert_same(path: Path, other: Path) -> None:
    one, two = clvol.load_result(path), clvol.load_result(other)
    np.testing.assert_allclose(one.image, two.image, rtol=3e-7)
    assert one.ranges == two.ranges and one.noise == pytest.approx(two.noise, rel=1e-3)


def test_merge_writes_the_picture_of_all_samples(folder: Path, tmp_path: Path) -> None:
    outputs = tmp_path / "c.exr", tmp_path / "c.png"
    said = run("merge", folder / "b.exr", folder / "a.exr", "-o", outputs[0], "-o", outputs[1])
    assert "c.exr, " in said and "32 spp (samples 0 to 31), noise" in said
    assert_same(outputs[0], folder / "whole.exr")
    assert outputs[1].stat().st_size > 0
    assert run("merge", folder / "a.exr", folder / "b.exr", "-o", outputs[0], "--quiet") == ""


def test_a_render_resumes_where_its_file_ended(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "r.exr"
    render(path, "--resume", "--spp", 8)  # nothing is there yet
    assert_same(path, folder / "a.exr")
    assert "32 spp" in render(path, "--resume", "--spp", 32)
    assert_same(path, folder / "whole.exr")
    before = path.read_bytes()
    assert "32 spp" in render(path, "--resume", "--spp", 16)
    assert clvol.load_result(path).ranges == ((0, 32),)
    assert "another seed: 0, not 5" in refused(
        "render", SCENE, "-D", "res=8", "--sampler", "joint", "-o", path, "--resume", "--seed", 5
    )
    assert len(path.read_bytes()) == pytest.approx(len(before), rel=0.01)


def test_mistakes_are_one_line(folder: Path, tmp_path: Path) -> None:
    a, b, c = folder / "a.exr", folder / "b.exr", tmp_path / "c.exr"
    for arguments, message in (
        (("merge", a, a, "-o", c), "overlapping samples: 0 to 7 occur twice"),
        (("merge", a, tmp_path / "none.exr", "-o", c), "none.exr: no such file"),
        (("merge", a, b, "-o", tmp_path / "c.txt"), "unknown format '.txt'"),
        (("merge", a, b), "missing option"),
        (("merge", "-o", c), "missing argument"),
        (("render", SCENE, "-o", tmp_path / "c.png", "--resume"), "--resume needs an .exr"),
        (
            ("render", VOLUME, "-o", tmp_path / "#.exr", "--resume", "--turntable", "3"),
            "--resume goes on with one picture",
        ),
    ):
        said = refused(*arguments)
        assert message in said and said.count("\n") == 1, said
        assert not c.exists()
