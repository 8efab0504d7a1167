"""What `import clvol` offers: one list, the same for who runs it and who reads it."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import clvol

LAZY = ("clvol", "clvol.lab.comparison")


def type_checkers_see(source: str) -> dict[str, str]:
    """Names and their modules of ours in the `if TYPE_CHECKING:` block of a module."""
    found = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for statement in node.body:
                assert isinstance(statement, ast.ImportFrom)
                found |= {alias.name: statement.module or "" for alias in statement.names}
    return {name: module for name, module in found.items() if module.startswith("clvol")}


@pytest.mark.parametrize("name", LAZY)
def test_the_lists_of_public_names_agree(name: str) -> None:
    module = importlib.import_module(name)
    assert type_checkers_see(Path(inspect.getfile(module)).read_text(encoding="utf-8")) == module._EXPORTS
    assert set(module.__all__) - {"__version__"} == set(module._EXPORTS)


@pytest.mark.parametrize("name", sorted(set(clvol.__all__) - {"__version__"}))
def test_public_names_are_documented(name: str) -> None:
    """Functions in numpy's form, with their parameters and what they raise."""
    found = getattr(clvol, name)
    text = inspect.getdoc(found)
    assert text
    if inspect.isfunction(found):
        for parameter in inspect.signature(found).parameters:
            assert parameter in text.partition("Parameters\n---")[2], parameter
        assert "Raises\n---" in text


def test_what_functions_return_is_public() -> None:
    returned = {
        inspect.signature(getattr(clvol, name)).return_annotation
        for name in clvol._EXPORTS
        if inspect.isfunction(getattr(clvol, name))
    }
    returned = {name for kind in returned for name in re.findall(r"[\w.]+", kind)}
    assert returned - {"np.ndarray", "list", "str", "dict", "Any", "Grid", "Iterator", "None"} <= set(
        clvol.__all__
    )


def test_nothing_is_imported_before_it_is_used() -> None:
    """NumPy alone takes longer than `clvol --help` may."""
    code = "import sys, clvol; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not {"numpy", "pyopencl", "scipy", "trimesh", "rich", "click"} & set(loaded.split())
