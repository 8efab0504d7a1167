"""Messages speak as the user does: Python in Python, options on the command line, XML of a scene's file."""

from __future__ import annotations

import ast
import inspect
import logging
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner
from places import ROOT
from vdb_writer import GridSpec, write_vdb

import clvol
from clvol.cli.main import main
from clvol.cli.messages import logging_to
from clvol.errors import OptionError, Told, either, option, parameter

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SPELLED = ("either", "option", "parameter", "spelled")


def said(*arguments: object) -> str:
    done = CliRunner().invoke(main, [str(a) for a in arguments])
    assert done.exit_code == 2, done.output
    return done.stderr


def test_an_error_has_the_words_of_both() -> None:
    error = OptionError(
        f"{option('time_limit')} is too short", "here", f"give {option('lookup', 'exact')}{either('!', '')}"
    )
    assert str(error) == 'here: time_limit is too short; give lookup="exact"!'
    assert error.told(command=True) == "here: --time is too short; give --lookup exact"
    assert OptionError(error.what, error.where, error.hint).told(command=True) == error.told(command=True)
    sane = OptionError("NaN", hint=parameter("sanitize", True))
    assert (str(sane), sane.told(command=True)) == ("NaN; sanitize=True", "NaN; --sanitize")
    sane.in_scene = True
    assert str(sane) == sane.told(command=True) == 'NaN; <boolean name="sanitize" value="true"/>'


def test_the_log_speaks_so_too(caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]) -> None:
    from clvol.base.progress import error_console

    with logging_to(error_console(), verbose=False):
        logging.getLogger("clvol").warning("%s: %d", Told(option("majorant_scale")), 3)
    assert "majorant_scale: 3" in caplog.text
    assert "--majorant-scale: 3" in capsys.readouterr().err


@pytest.fixture
def nan(tmp_path: Path) -> Path:
    values = np.ones((2, 3, 4), np.float32)
    values[0, 0, 0] = np.nan
    np.save(tmp_path / "nan.npy", values)
    return tmp_path / "nan.npy"


def test_a_broken_volume_is_mended_where_it_is_named(nan: Path, tmp_path: Path) -> None:
    command = "render", nan, "-o", tmp_path / "a.png"
    assert "as 0: --sanitize" in said(*command)
    with pytest.raises(clvol.VolumeError, match=r"as 0: sanitize=True$"):
        clvol.volume_scene(nan)
    values = np.ones((2, 3, 4), np.float32)
    np.save(nan, values)
    scene = tmp_path / "a.xml"
    assert CliRunner().invoke(main, ["scene", str(nan), "-o", str(scene)]).exit_code == 0
    values[0, 0, 0] = np.nan
    np.save(nan, values)
    element = 'as 0: <boolean name="sanitize" value="true"/>'
    assert element in said("render", scene, "-o", tmp_path / "a.png")
    with pytest.raises(clvol.VolumeError, match=re.escape(element)):
        clvol.load_file(scene)


def test_grids_are_chosen_by_what_the_user_has(tmp_path: Path) -> None:
    path = tmp_path / "a.vdb"
    tiles = [((0, 0, 0), 8, 1.0, True)]
    write_vdb(path, [GridSpec(name="one", tiles=tiles), GridSpec(name="two", tiles=tiles)])
    assert "choose one by --density 'one'" in said("render", path, "-o", tmp_path / "a.png")
    with pytest.raises(clvol.VolumeError, match="choose one by density='one'"):
        clvol.volume_scene(path)
    np.savez(tmp_path / "a.npz", one=np.ones((2, 2, 2)), two=np.ones((2, 2, 2)))
    with pytest.raises(clvol.VolumeError, match="name one by grid: 'one', 'two'"):
        clvol.load_volume(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["render", "a.xml", "-o", "a.exr", "--spp", "1e3"], "'--spp': '1e3' is not a whole number"),
        (["render", "a.xml", "-o", "a.exr", "--step", "x"], "'--step': 'x' is not a number"),
        (["ray", "a.xml", "x", "1"], "'X': 'x' is not a whole number"),
    ],
)
def test_numbers_are_told_without_the_names_of_types(words: list[str], message: str) -> None:
    assert message in CliRunner().invoke(main, words).output


def test_a_volume_is_no_scene_in_either_language(nan: Path) -> None:
    assert "`clvol render`" in said(
        "compare", nan, "--techniques", "delta,regular", "-o", nan.with_name("report")
    )
    with pytest.raises(clvol.SceneError, match=r"volume_scene makes a scene of it$"):
        clvol.load_file(nan)


def test_no_message_of_the_library_is_in_one_language_alone() -> None:
    """Options by the words of Python or of the command line are spelled by `clvol.errors`."""
    names = {*inspect.signature(clvol.render).parameters, *inspect.signature(clvol.volume_scene).parameters}
    names -= {"scene", "progress", "aov", "client"}  # what the command line cannot give wrongly
    wrong = re.compile(rf"(?<![\w-])--[a-z]|\b({'|'.join(sorted(names))})=|`clvol \w+ |max_bytes")
    found = []
    for path in sorted((ROOT / "clvol").rglob("*.py")):
        room = path.relative_to(ROOT / "clvol").parts[0]
        if room in ("cli", "viewer", "errors.py") or path.name in ("tev.py", "saving.py", "plotting.py"):
            continue
        for text in _messages(ast.parse(path.read_text(encoding="utf-8"))):
            if wrong.search(text.replace("`pbrt --upgrade FILE`", "")):  # a command of pbrt's
                found.append(f"{path.name}: {text}")
    assert not found


def _messages(tree: ast.AST) -> Iterator[str]:
    """Texts in what is raised or logged, and hints; but for those that are spelled."""
    for node in ast.walk(tree):
        is_log = isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("warning", "fail")
        is_hint = isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("hint", "what")
        if isinstance(node, ast.Raise) or is_log or is_hint:
            yield from _texts(node)


def _texts(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") in SPELLED:
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    for child in ast.iter_child_nodes(node):
        yield from _texts(child)
