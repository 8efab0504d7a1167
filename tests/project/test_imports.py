"""No module imports itself by way of others, at its top, in a function or for its types alone.

Which room may import which is import-linter's part (`lint-imports`, contracts in pyproject.toml).
"""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

import pytest
from places import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CLVOL = ROOT / "clvol"


def modules_in(package: Path) -> dict[str, Path]:
    """Files of a package by the dotted names of their modules."""
    found = {}
    for path in package.rglob("*.py"):
        parts = path.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported_by(path: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules of the package that a file imports anywhere; `from a import b` is of a.b where that is one."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: say from where in full"
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name if name in known else node.module for name in names if node.module in known)


def circle_in(package: Path) -> list[str]:
    """Modules each of which imports the next, the first again at the end; empty if there are none."""
    known = modules_in(package)
    graph = {name: set(imported_by(path, known)) for name, path in known.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_module_imports_itself_by_way_of_others() -> None:
    assert circle_in(CLVOL) == []


@pytest.mark.parametrize(
    "text",
    [
        "from toy.b import name",
        "def later():\n    from toy import b",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import toy.b",
    ],
)
def test_a_circle_is_found_wherever_its_imports_stand(tmp_path: Path, text: str) -> None:
    (tmp_path / "toy").mkdir()
    (tmp_path / "toy" / "__init__.py").write_text("")
    (tmp_path / "toy" / "a.py").write_text(text)
    (tmp_path / "toy" / "b.py").write_text("import json\n")
    assert circle_in(tmp_path / "toy") == []
    (tmp_path / "toy" / "b.py").write_text("class B:\n    def c(self):\n        import toy.a\n")
    assert set(circle_in(tmp_path / "toy")) == {"toy.a", "toy.b"}
