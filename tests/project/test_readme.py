"""What the README promises: its example runs, and its tables name every choice and every plugin."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from clvol.planning.registry import AOVS, FAMILIES
from clvol.scene.loader import PLUGINS

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PLUGIN_NAMES = sorted({name for plugins in PLUGINS.values() for name in plugins} - {"scene"})


def test_the_two_commands_stand_at_the_top_with_the_picture() -> None:
    top = README[:900]
    assert ".venv/bin/pip install . && .venv/bin/clvol render scenes/fire.xml -o fire.exr" in top
    assert ".venv/bin/pip install '.[test]' && .venv/bin/pytest" in top
    [picture] = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", top)
    assert (ROOT / picture).is_file()


@pytest.mark.parametrize("family", FAMILIES)
def test_the_table_lists_every_choice(family: str) -> None:
    [row] = re.findall(rf"^\| `--{family}` \| (.*) \|$", README, re.MULTILINE)
    assert re.findall(r"`([\w-]+)`", row) == list(FAMILIES[family])


@pytest.mark.parametrize("name", PLUGIN_NAMES)
def test_the_table_lists_every_plugin(name: str) -> None:
    table = README.split("## What is supported")[1].split("\n## ")[0]
    assert f"`{name}`" in table


def test_the_examples_run_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    examples = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (tmp_path / "scenes").symlink_to(ROOT / "scenes", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    exec("\n".join(examples), {})
    assert (tmp_path / "cloud.exr").stat().st_size > 10000


def test_the_gallery_shows_pictures_of_scenes_that_are_there() -> None:
    gallery = README.split("## Gallery")[1].split("\n## ")[0]
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", gallery)
    assert len(pictures) >= 4
    for picture in pictures:
        assert (ROOT / picture).stat().st_size <= 300_000
        assert f"scenes/{Path(picture).stem}.xml" in gallery
    for scene in (ROOT / "scenes").glob("*.xml"):
        assert scene.name in gallery


@pytest.mark.parametrize("aov", AOVS)
def test_the_table_lists_every_aov(aov: str) -> None:
    table = README.split("| AOVs |")[1].split("\n\n")[0]
    assert f"`{aov}`" in table


@pytest.mark.parametrize("listed", ["clvol", "cl", "scenes", "tests", "tools", ".ci/run", "CONTRIBUTING.md"])
def test_what_is_listed_is_there(listed: str) -> None:
    assert listed in README
    assert (ROOT / listed).exists()
