"""What the documentation promises.

Tables name every choice and plugin, files and links lead somewhere, the examples run, and what comments cite
is there.
"""

from __future__ import annotations

import re
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from places import ROOT, SCENES

import clvol
from clvol.planning.registry import AOVS, FAMILIES, option
from clvol.scene.loader import PLUGINS

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
PLUGIN_NAMES = sorted({name for plugins in PLUGINS.values() for name in plugins} - {"scene"})
ROOMS = ("clvol", "cl", "tests", "tools", "scenes", "docs")
FILE = re.compile(r"(?<![\w/.<-])(?:[\w-]+/)*[\w-]+\.(?:py|h|cl|xml|md|vol|ply|yml|toml|cff)\b(?![\w/(-])")
PLACE = re.compile(rf"(?<![\w/.<-])(?:{'|'.join(ROOMS)})/[\w/.-]*\w(?![\w*])")
MADE_UP = {"tracking/coin.h", "scene.xml", "clvol/_cl", "mi.load_file"}
"""Of examples and of installations."""


def text_of(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


@cache
def sources() -> dict[Path, str]:
    """Every text file of the rooms."""
    found = (p for room in ROOMS for p in (ROOT / room).rglob("*") if p.suffix in {".py", ".h", ".cl", ".md"})
    return {p: p.read_text(encoding="utf-8") for p in found}


@cache
def names() -> set[str]:
    """Names of all files, without their folders."""
    return {p.name for room in ROOMS for p in (ROOT / room).rglob("*")} | {p.name for p in ROOT.iterdir()}


def is_there(name: str) -> bool:
    if "NAME" in name or "STAGE" in name or name in MADE_UP:
        return True
    places = [ROOT / name, ROOT / "cl" / name, ROOT / "clvol" / name, DOCS / name]
    return any(place.exists() for place in places) or ("/" not in name and name in names())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_is_named_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = {*FILE.findall(text), *PLACE.findall(text)}
    assert not {name for name in named if not is_there(name)}


def anchor(heading: str) -> str:
    """As Python-Markdown and GitHub make it of plain headings."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("https://"):
            continue
        file, _, fragment = target.partition("#")
        linked = (page.parent / file).resolve() if file else page
        assert linked.is_file(), target
        if fragment:
            headings = re.findall(r"^#+ (.+)$", linked.read_text(encoding="utf-8"), re.MULTILINE)
            assert fragment in {anchor(heading) for heading in headings}, target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_list_is_one_to_markdown_too(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    joined = re.findall(r"^(?! |-|\d+\.|#|\|).+\n(?:-|1\.) .*", text, re.MULTILINE)
    assert not joined, "a list begins after an empty line"


def test_the_rooms_stand_in_the_order_that_is_checked() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    [layers] = [contract["layers"] for contract in settings["contracts"] if contract["id"] == "rooms"]
    rooms = [name for layer in reversed(layers) for name in layer.split(" | ")]
    table = re.findall(r"^\| `clvol/(\w+)(?:/|\.py)` \|", text_of("architecture.md"), re.MULTILINE)
    assert table == [room for room in rooms if room not in ("errors", "version")]


def test_every_page_is_in_the_navigation() -> None:
    navigation = re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert sorted(navigation) == sorted(page.name for page in DOCS.glob("*.md"))


def test_the_reference_has_every_public_name() -> None:
    described = re.findall(r"^::: .*\b(\w+)$", text_of("api.md"), re.MULTILINE)
    assert set(clvol.__all__) - set(described) == {"__version__"}


def test_every_method_that_is_cited_has_its_heading() -> None:
    headings = set(re.findall(r"^## (\d+)\. ", text_of("methods.md"), re.MULTILINE))
    cited = {(path, n) for path, text in sources().items() for n in re.findall(r"METHODS §(\d+)", text)}
    assert len(cited) > 30
    assert not {(path, n) for path, n in cited if n not in headings}
    vague = re.compile(r"\bMETHODS\b(?! §\d)")
    kernels = {path: text for path, text in sources().items() if path.suffix in {".h", ".cl"}}
    assert not [path for path, text in kernels.items() if vague.search(text)]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_table_lists_every_choice(family: str) -> None:
    [row] = re.findall(rf"^\| `{option(family)}` \| (.*) \|$", text_of("choices.md"), re.MULTILINE)
    assert re.findall(r"`([\w-]+)`", row) == list(FAMILIES[family])


@pytest.mark.parametrize("name", PLUGIN_NAMES)
def test_the_table_lists_every_plugin(name: str) -> None:
    table = text_of("scenes.md").split("\n## ")[0]
    assert f"`{name}`" in table


@pytest.mark.parametrize("aov", AOVS)
def test_the_table_lists_every_aov(aov: str) -> None:
    table = text_of("command-line.md").split("| AOVs |")[1].split("\n\n")[0]
    assert f"`{aov}`" in table


@pytest.mark.contract
def test_the_first_examples_run_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    examples = re.findall(r"```python\n(.*?)```", text_of("getting-started.md"), re.DOTALL)
    (tmp_path / "scenes").symlink_to(SCENES, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    exec("\n".join(examples), {})
    assert (tmp_path / "cloud.exr").stat().st_size > 10000


def test_every_scene_and_the_command_of_every_picture_stand_in_the_gallery() -> None:
    gallery = text_of("gallery.md")
    for scene in (SCENES).glob("*.xml"):
        assert scene.name in gallery
    for picture in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", gallery):
        assert (DOCS / picture).is_file()
        name = Path(picture).stem.removesuffix("-denoised")
        made = re.search(rf"`clvol render scenes/{name}.xml -o {name}.png [^`]+`", gallery)
        assert made or f'.save("{name}.png"' in gallery


def test_denoised_pictures_are_there_twice_where_a_page_shows_both(
    tool: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "docs", raising=False)
    docs = tool("docs")
    asked: list[list[str]] = []

    class Called(Exception):  # noqa: N818
        """What is asked of clvol is all that is wanted."""

    def call(words: list[str]) -> None:
        asked.append(words)
        raise Called

    monkeypatch.setattr(docs, "call", call)
    for name in ("column", "shaft"):
        with pytest.raises(Called):
            docs.run(docs.commands()[name], name)
    assert all("--denoise" in words for words in asked)
    assert asked[0][-1] == "docs/pictures/column.png"
    assert asked[1][-1].endswith(".exr")
