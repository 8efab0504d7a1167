"""`clvol.devices` and `clvol.info` answer from Python what the commands print."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner
from places import SCENES

import clvol
from clvol.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path


def printed(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    return done.output.rstrip("\n")


def test_info_is_what_the_command_prints(tmp_path: Path) -> None:
    scene = SCENES / "slab.xml"
    clvol.render(clvol.load_file(scene, res=8), spp=2).save(tmp_path / "a.exr")
    for what in (SCENES / "cloud.vol", SCENES / "fire.vdb", scene, tmp_path / "a.exr"):
        assert clvol.info(what) == printed("info", what)
    told = printed("info", scene, "--technique", "spectral")
    assert clvol.info(scene, technique="spectral") == told.replace("note: --technique", "note: technique")
    assert clvol.info(clvol.load_file(scene)) == clvol.info(str(scene))
    assert repr(clvol.info(scene)) == str(clvol.info(scene))


def test_info_of_nothing_is_the_installation(device) -> None:
    text = clvol.info()
    assert clvol.__version__ in text and device.info.name in text


def test_devices_are_those_of_the_command(device) -> None:
    found = clvol.devices()
    assert device.info in found
    assert [f"{one.index}: {one.name}" for one in found] == [
        line for line in printed("devices").splitlines() if line[0].isdigit()
    ]


def test_what_info_cannot_tell_is_said() -> None:
    for options, message in (
        ({"what": 3}, "does not know what 3 is"),
        ({"what": SCENES / "cloud.vol", "technique": "delta"}, "technique is for the render of a scene"),
        ({"what": SCENES / "slab.xml", "grid": "density"}, "grid chooses from a volume file"),
        ({"grid": "density"}, "grid chooses from a volume file"),
    ):
        with pytest.raises(clvol.OptionError, match=message):
            clvol.info(**options)
