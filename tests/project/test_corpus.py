"""tools/corpus.py counts which scenes load, and tells the shares that count."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from places import TOOLS

if TYPE_CHECKING:
    from pathlib import Path


def test_a_corpus_is_counted_by_what_loads_and_what_is_missing(tmp_path: Path) -> None:
    sensor = '<sensor type="perspective"/>'
    mesh = '<shape type="obj"><string name="filename" value="a.obj"/></shape>'
    scenes = {"bad": f'{mesh}<bsdf type="felt"/>', "bare": mesh, "good": ""}
    for name, inside in scenes.items():
        (tmp_path / f"{name}.xml").write_text(f'<scene version="3.0.0">{sensor}{inside}</scene>')
    (tmp_path / "part.xml").write_text('<scene version="3.0.0"><bsdf type="felt"/></scene>')
    for options, wanted in ([], "refused incomplete loads"), (["--stand-ins"], "refused loads loads"):
        command = [sys.executable, str(TOOLS / "corpus.py"), str(tmp_path), *options]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert [line.split()[0] for line in told.splitlines() if ".xml" in line] == wanted.split()
        assert "     1  unsupported: unknown bsdf 'felt'" in told


def test_the_shares_of_a_corpus_leave_out_what_lacks_files_or_is_for_other_programs(tmp_path: Path) -> None:
    fog = '<medium type="homogeneous" id="a"/>'
    scenes = {
        "good": fog,
        "bad": f'{fog}<bsdf type="coating"/>',
        "lacking": f'{fog}<path value="nowhere"/><bsdf type="coating"/>',
        "foreign": f'{fog}<integrator type="felt"/>',
        "element": f'{fog}<mode type="final"/>',
        "surface": "",
    }
    sensor = '<sensor type="perspective"/>'
    for version in ("0.6.0", "3.0.0"):
        for name, inside in scenes.items():
            scene = f'<scene version="{version}">{sensor}{inside}</scene>'
            (tmp_path / f"{name}{version}.xml").write_text(scene)
    command = [sys.executable, str(TOOLS / "corpus.py"), str(tmp_path)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = {tuple(line.split()[:2]): line.split()[2:] for line in told.splitlines() if line[1:3] == ".x"}
    assert rows[("0.x", "yes")] == rows[("3.x", "yes")] == ["5", "1", "2", "2", "1", "50%"]
    assert rows[("3.x", "no")] == ["1", "0", "0", "1", "1", "100%"]
    assert "versions 2 and 3: 1 of 2 load, 50% (at least 95% should)" in told
    assert "versions before 2: 1 of 2 load, 50% (at least 90% should)" in told


@pytest.mark.parametrize(
    ("what", "foreign"),
    [
        ("unknown integrator 'vrl2'", True),
        ("unknown bsdf 'coating'", False),
        ("integrator 'ao' is not supported in this version", False),
        ("unknown element <mode>", True),
        ("unknown element <animation>", False),
        ("unknown parameter 'version' of integrator 'felt'", False),
    ],
)
def test_what_no_release_of_mitsuba_has_is_told_by_its_name(tool, what, foreign) -> None:
    assert tool("mitsuba_names").is_foreign(what) == foreign
