"""`clvol selftest` without a scene renders hard cases, and tells which are wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest
from click.testing import CliRunner

from clvol.cli.main import main
from clvol.lab.hard import suite

CASES = [case for case in suite.CASES if case.name.endswith(("along z", "in a plane of bricks"))]


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(suite, "quick_part", lambda: CASES[:1])
    monkeypatch.setattr(suite, "TURNS", (suite.TURNS[1],))


def test_right_cases_are_told_and_pass(few):
    done = CliRunner().invoke(main, ["selftest", "--quick"])
    assert done.exit_code == 0, done.output
    assert done.output.startswith(f"right      {CASES[0].name}: ")
    assert done.output.endswith("1 of 1 cases are right, 0 too noisy to show anything, 0 wrong.\n")


def test_a_wrong_case_is_told_and_fails(few, monkeypatch):
    wrong = replace(CASES[0], expected=lambda: 1.3 * CASES[0].expected())
    monkeypatch.setattr(suite, "CASES", (wrong,))
    monkeypatch.setattr(suite, "quick_part", lambda: (wrong,))
    done = CliRunner().invoke(main, ["selftest", "--quick", "--alpha", "1e-3"])
    assert done.exit_code == 1
    assert done.output.startswith("WRONG ")


@pytest.mark.parametrize("option", [("--time", "3"), ("-D", "a=1")])
def test_what_is_for_a_scene_is_refused_without_one(option):
    done = CliRunner().invoke(main, ["selftest", *option])
    assert done.exit_code == 2
    assert f"{option[0]} is for a scene" in done.stderr


def test_the_quick_part_has_every_group():
    assert {case.group for case in suite.quick_part()} == set(suite.GROUPS)
