"""`clvol render --set NAME=VALUE` sets what `clvol.traverse` names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner
from places import SCENES

import clvol
from clvol.cli.main import main
from clvol.scene.assignments import assign

if TYPE_CHECKING:
    from pathlib import Path

SLAB = str(SCENES / "slab.xml")


def test_a_render_with_set_is_that_of_the_traversed_scene(tmp_path: Path) -> None:
    name = next(one for one in clvol.traverse(clvol.load_file(SLAB)) if one.endswith("medium.scale"))
    options = ["-D", "res=8", "--spp", "2", "--quiet"]
    view = ["--set", "sensor.to_world=0,-4,1, 0,0,0, 0,0,1", "--set", f"{name}=3"]
    done = CliRunner().invoke(main, ["render", SLAB, "-o", str(tmp_path / "a.exr"), *options, *view])
    assert done.exit_code == 0, done.output
    scene = clvol.load_file(SLAB, res=8)
    parameters = clvol.traverse(scene)
    parameters.update({"sensor.to_world": clvol.look_at([0, -4, 1], [0, 0, 0], [0, 0, 1]), name: 3.0})
    assert np.array_equal(clvol.load_result(tmp_path / "a.exr").image, clvol.render(scene, spp=2).image)


def test_transforms_take_all_their_numbers_too() -> None:
    scene = clvol.load_file(SLAB)
    matrix = clvol.look_at([0, -5, 1], [0, 0, 0], [0, 0, 1])
    assign(scene, [("sensor.to_world", ",".join(map(repr, matrix.reshape(-1).tolist())))])
    assert np.array_equal(scene.sensor.to_world, matrix)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("sensor.x_fov", "--set takes NAME=VALUE"),
        ("=3", "--set takes NAME=VALUE"),
        ("sensor.x_fov=", "takes numbers"),
        ("sensor.x_fov=wide", "takes numbers"),
        ("sensor.x_fov=nan", "sensor.x_fov"),
        ("sensor.x_fov=1,2", "sensor.x_fov"),
        ("sensor.fow=30", "has no parameter"),
        ("sensor.to_world=0,0,0,0,0,0,0,0,1", "sensor.to_world"),
        ("sensor.to_world=1,2,3", "sensor.to_world"),
        ("sensor.film.size=8,0", "sensor.film.size"),
    ],
)
def test_what_cannot_be_set_is_one_line(tmp_path: Path, given: str, said: str) -> None:
    done = CliRunner().invoke(main, ["render", SLAB, "-o", str(tmp_path / "a.png"), "--set", given])
    assert done.exit_code == 2
    assert done.stderr.startswith("clvol: error: ") and done.stderr.count("\n") == 1, done.stderr
    assert said in done.stderr
