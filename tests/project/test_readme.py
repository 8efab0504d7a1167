"""What the README promises: its commands, its example, its pictures."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from places import ROOT, SCENES

if TYPE_CHECKING:
    from pathlib import Path

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_it_is_short() -> None:
    assert len(README.splitlines()) <= 120


def test_the_two_commands_stand_at_the_top_with_the_picture() -> None:
    top = README[:900]
    assert ".venv/bin/pip install . && .venv/bin/clvol render scenes/fire.xml -o fire.exr" in top
    assert ".venv/bin/pip install '.[test]' && .venv/bin/pytest" in top
    [picture] = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", top)
    assert (ROOT / picture).stat().st_size < 200_000


def test_the_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    [example] = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (tmp_path / "scenes").symlink_to(SCENES, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    exec(example, {})
    assert (tmp_path / "cloud.exr").stat().st_size > 10000


def test_the_gallery_shows_small_pictures_of_scenes_that_are_there() -> None:
    gallery = README.split("## Gallery")[1].split("\n## ")[0]
    pictures = [ROOT / name for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", gallery)]
    assert len(pictures) >= 4
    assert sum(picture.stat().st_size for picture in pictures) < 1_000_000
    for picture in pictures:
        assert f"scenes/{picture.stem.removesuffix('-denoised')}.xml" in gallery


@pytest.mark.parametrize("listed", ["clvol", "cl", "scenes", "docs", "tests", "tools", ".ci/run"])
def test_what_is_listed_is_there(listed: str) -> None:
    assert re.search(rf"^{re.escape(listed)}/?  ", README, re.MULTILINE)
    assert (ROOT / listed).exists()
