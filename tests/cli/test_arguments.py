"""Arguments that won't do are refused before anything is read; options that take one value are given once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner
from places import SCENES

import clvol
from clvol.cli.main import main
from clvol.staging.source import Source

if TYPE_CHECKING:
    from pathlib import Path

SMOKE, VOLUME = SCENES / "smoke.xml", SCENES / "fire.vdb"
DELTA = "--technique", "delta", "--transmittance", "ratio"
STEP = "--step is for ray marching, and nothing marches here; choose --technique marching"


def refused(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 2, done.output
    [line] = done.stderr.splitlines()
    return line


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["render", SMOKE, "-o", "a.exr", "--spp", "2", "--samples", "0,2"], "--spp and --samples exclude"),
        (["render", VOLUME, "-o", "a.exr", "--samples", "0,0"], "cannot render 0 samples per pixel"),
        (["render", VOLUME, "-o", "a.exr", "--samples=-1,4"], "from sample -1 on"),
        (
            ["render", SMOKE, "-o", "a.exr", "--target-error", "1", "--samples", "0,2"],
            "exclude each other",
        ),
        (["render", SMOKE, "-o", "a.exr", "--resume", "--target-error", "1"], "cannot go on from another"),
        (["render", SMOKE, "-o", "a.exr", "--workers", "2", "--scheduler", "tcp://x:1"], "not both"),
        (["render", SMOKE, "-o", "a.exr", "--workers", "2", "--profile"], "a cluster takes no --profile"),
        (["render", SMOKE, "-o", "a.exr", "--workers", "2", "--device", "all"], "each worker of a cluster"),
        (["render", SMOKE, "-o", "a.exr", "--scheduler", "nonsense"], "no scheduler answers at nonsense"),
        (["render", SMOKE, "-o", "a.exr", "--aov", "cels"], "did you mean 'cells'"),
        (["render", SMOKE, "-o", "a.exr", "--seed", 2**70], "is not a 64-bit number"),
        (["render", VOLUME, "-o", "a.exr", "--step", "0.1"], STEP),
        (
            [
                "render",
                SMOKE,
                "-o",
                "a.exr",
                "--step",
                "1",
                "--technique",
                "delta",
                "--transmittance",
                "ratio",
            ],
            STEP,
        ),
        (["compare", SMOKE, "-o", "report", "--techniques", "delta"], "only one combination"),
        (["compare", SMOKE, "-o", "report", "--reference", "a.exr", "--reference-spp", "8"], "not both"),
    ],
)
def test_arguments_are_checked_before_the_scene_is_read(
    arguments: list[object], says: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(clvol, "load_file", None)
    monkeypatch.setattr(Source, "open", None)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.exr").touch()
    assert says in refused(*arguments)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["render", SMOKE, "-o", "a.exr", "-D", "a=1", "-D", "b=2", "-D", "a=2"], "'-D': a is given twice"),
        (["render", SMOKE, "-o", "a.exr", "--set", "x=1", "--set", " x =2"], "'--set': x is given twice"),
        (["render", SMOKE, "-o", "a.exr", "--spp", "2", "--spp", "2"], "--spp is given twice"),
        (["view", VOLUME, "--light", "sun", "--light", "sky"], "--light is given twice"),
        (["scene", VOLUME, "-o", "a.xml", "-o", "b.xml"], "--output is given twice"),
        (["info", VOLUME, "--grid", "a", "--grid", "b"], "--grid is given twice"),
        (["compare", SMOKE, "-o", "r", "--technique", "delta", "--techniques", "regular"], "is given twice"),
    ],
)
def test_no_value_is_left_out_without_a_word(
    arguments: list[object], says: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in refused(*arguments)


def test_what_adds_up_may_be_repeated(tmp_path: Path) -> None:
    scene = SCENES / "slab.xml"
    outputs = "-o", tmp_path / "a.exr", "-o", tmp_path / "a.png", "--aov", "cells", "--aov", "null"
    words = "render", scene, *outputs, "-D", "res=2", "--spp", "1", "--quiet", "--quiet"
    assert CliRunner().invoke(main, [str(word) for word in words]).exit_code == 0
