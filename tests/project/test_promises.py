"""The page of promises: its words stand in the README, and the tests that it names are there."""

from __future__ import annotations

import ast
import re

import pytest
from places import ROOT

PAGE = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
README = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
ROWS = re.findall(r"^\| (?!promise|---)(.+?) \| (.+) \|$", PAGE, re.MULTILINE)
NAMED = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", PAGE)


@pytest.mark.parametrize("promise", re.findall(r'^\| "(.+?)" \|', PAGE, re.MULTILINE))
def test_a_promise_stands_in_the_readme(promise: str) -> None:
    assert " ".join(promise.split()) in README


@pytest.mark.parametrize(("file", "name"), NAMED)
def test_a_test_that_holds_a_promise_is_there(file: str, name: str) -> None:
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    tests = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert name in tests if name else any(test.startswith("test_") for test in tests)


def test_every_promise_has_a_test_and_every_command_of_the_readme_a_promise() -> None:
    assert len(ROWS) > 30
    assert all("`tests/" in held for _, held in ROWS)
    commands = re.findall(
        r"^clvol (\w+) .*?   +(\w.*)$", (ROOT / "README.md").read_text(encoding="utf-8"), re.M
    )
    promises = " ".join(promise for promise, _ in ROWS)
    words = re.findall('"(.+?)"', promises)
    missing = [command for command, said in commands if not any(word in said for word in words)]
    assert not set(missing) - {"render"}
