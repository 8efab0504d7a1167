"""What tests of the project's own tools share."""

import importlib
from types import ModuleType

import pytest
from places import TOOLS


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch):
    """Import a module of tools/ by name."""
    monkeypatch.syspath_prepend(TOOLS)

    def load(name: str) -> ModuleType:
        return importlib.import_module(name)

    return load
