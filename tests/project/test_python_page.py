"""The examples of docs/python.md run one after the other, as they stand there."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from places import ROOT, SCENES

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.contract
def test_the_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    (tmp_path / "scenes").symlink_to(SCENES, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for example in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(example, names)
    assert (tmp_path / "turn-020.png").stat().st_size > 1000
