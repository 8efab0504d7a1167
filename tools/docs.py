"""Regenerates all figures and pictures of docs/: `python tools/docs.py all`, or a part of them.

Pictures and the view of a ray are made by the very commands that stand beside them in docs/, the tables of
techniques by `clvol.compare`, the pilot's by tools/pilot.py and the performance table by tools/bench.py.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import bench
import click
import hard_cases
import hard_mitsuba
from benchmarks.options import mitsuba_option
from benchmarks.scene_tables import overview
from benchmarks.tables import judge
from docs_tables import ROOT, performance_part, pilot_page, techniques_page, transitions_part
from documents import between, writable, write
from pilot import SCENES, pilot_options, tested
from recipes import RECIPES

from clvol import load_result
from clvol.cli.messages import OneLineErrors

if TYPE_CHECKING:
    from collections.abc import Callable

DOCS = ROOT / "docs"
PERFORMANCE, ARCHITECTURE = DOCS / "performance.md", DOCS / "architecture.md"
RECIPES_PAGE = DOCS / "recipes.md"
COMMAND_LINE, README = DOCS / "command-line.md", ROOT / "README.md"
PICTURED = ("getting-started.md", "gallery.md", "ray.md")
"""Pages whose commands make their pictures."""
FIRST, LAST = "<!-- performance: written by tools/docs.py -->", "<!-- end of performance -->"
IN_README = "<!-- speed: written by tools/docs.py -->", "<!-- end of speed -->"
PROFILE = "<!-- profile: written by tools/docs.py -->", "<!-- end of profile -->"
TRANSITIONS = "<!-- transitions: written by tools/docs.py -->", "<!-- end of transitions -->"


def pages() -> str:
    """What stands in them."""
    return "\n".join((DOCS / page).read_text(encoding="utf-8") for page in PICTURED)


def commands() -> dict[str, list[str]]:
    """The commands of docs/ that make its pictures and films, by their names."""
    text, found = pages(), {}
    for line in re.findall(r"clvol (?:render|ray) scenes/[^`\n]+", text):
        words = shlex.split(line)
        for output in (words[n + 1] for n, word in enumerate(words[:-1]) if word == "-o"):
            if re.search(rf"pictures/{re.escape(Path(output).name)}[)\"]", text):
                found[Path(output).stem] = words
    return found


def without(words: list[str], *options: str) -> list[str]:
    """A command without these options, each of which takes a value."""
    kept, rest = [], iter(words)
    for word in rest:
        if word in options:
            next(rest)
        else:
            kept.append(word)
    return kept


def run(words: list[str], name: str) -> None:
    """One of these commands, with its output in docs/pictures.

    A denoised picture is there twice where a page shows NAME-denoised.png: that is what the command writes,
    and NAME.png what it writes without --denoise, of the same samples.
    """
    output = Path("docs/pictures") / Path(words[words.index("-o") + 1]).name
    if "--denoise" not in words or f"pictures/{name}-denoised.png" not in pages():
        call([*without(words[1:], "-o"), "-o", str(output)])
        return
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "picture.exr"
        call([*without(words[1:], "-o", "--exposure"), "-o", str(whole)])
        result = load_result(whole)
    stops = words[words.index("--exposure") + 1] if "--exposure" in words else "0"
    exposure = stops if stops == "auto" else float(stops)
    result.save(ROOT / output.with_stem(f"{name}-denoised"), exposure)
    result.denoised = None
    result.metadata.pop("denoised")
    result.save(ROOT / output, exposure)


def call(words: list[str]) -> None:
    """Run a command of clvol; click.ClickException where it fails."""
    if subprocess.run([sys.executable, "-m", "clvol.cli.main", *words], cwd=ROOT).returncode:
        raise click.ClickException(f"{shlex.join(words)} failed; what it said stands above")


def scan() -> None:
    """The picture of a scan, by the lines of gallery.md; skipped without its volume, which is not clvol's."""
    folder = os.environ.get("CLVOL_DATA", "")
    if not (Path(folder) / "stent.npz").is_file():
        click.echo("stent: skipped, since CLVOL_DATA names no folder with stent.npz")
        return
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    (lines,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "stent.npz").symlink_to(Path(folder).resolve() / "stent.npz")
        subprocess.run([sys.executable, "-c", lines], cwd=place, check=True)
        shutil.copy(Path(place) / "stent.png", DOCS / "pictures")


def enclosed(path: Path) -> tuple[str, str]:
    """What stands before and after the performance table; click.ClickException where it has no markers."""
    return between(path.read_text(encoding="utf-8"), FIRST, LAST, path.name)


@click.group(cls=OneLineErrors)
def main() -> None:
    """Regenerate the figures and pictures of docs/, or a part of them.

    \b
    python tools/docs.py all --mitsuba PYTHON
    python tools/docs.py pictures jade
    """


@main.result_callback()
def finish(status: int | None) -> int:
    """The exit status: 1 where something is not as it should be, or could not be measured."""
    return status or 0


def output_option(default: Path) -> Callable[[Callable], Callable]:
    """--output FILE, refused at once where it cannot be written."""
    kind = click.Path(path_type=Path)
    return click.option("--output", default=default, type=kind, callback=writable, metavar="FILE")


@main.command()
@click.argument("names", nargs=-1)
def pictures(names: tuple[str, ...]) -> None:
    """The pictures of docs/, or only those NAMES, by the commands that stand beside them."""
    known = commands()
    for name in names:
        if name not in known and name != "stent":
            have = ", ".join((*known, "stent"))
            raise click.BadParameter(f"no page has a command that makes {name!r}, but {have}")
    for name in names or (*known, "stent"):
        if name == "stent":
            scan()
            continue
        click.echo(shlex.join(known[name]))
        run(known[name], name)


@main.command()
@click.option("--seconds", default=10.0, show_default=True, help="Of each combination.")
@click.option("--rounds", default=10, show_default=True, type=click.IntRange(min=4))
@output_option(DOCS / "techniques.md")
def techniques(seconds: float, rounds: int, output: Path) -> None:
    """The tables of techniques.md: every technique and transmittance, on three scenes; the samplers."""
    write(output, techniques_page(seconds, rounds))


@main.command()
@pilot_options
@output_option(DOCS / "pilot.md")
def pilot(spp: int, rounds: int, more: int, scenes: tuple[str, ...], device: str | None, output: Path) -> int:
    """The table of pilot.md: what `auto:pilot` chooses on five scenes, beside the best that was found.

    The exit status is 1 where a choice is more than 20 % less efficient than the best.
    """
    only = "".join(f" --scene {name}" for name in scenes)
    command = f"python tools/docs.py pilot --spp {spp} --rounds {rounds} --more {more}{only}"
    outcomes = (tested(name, spp, rounds, more, device) for name in scenes or SCENES)
    text, within = pilot_page(command, outcomes, spp=spp, rounds=rounds, more=more)
    write(output, text)
    return 0 if within else 1


@main.command()
@bench.all_options
@output_option(PERFORMANCE)
@click.option(
    "--readme",
    default=README,
    type=click.Path(path_type=Path),
    callback=writable,
    metavar="FILE",
    help="Where the six scenes go in short.",
)
@click.option(
    "--figures",
    "measured",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    metavar="FILE",
    help="Figures that `tools/bench.py all --json FILE` has measured on this machine, instead of measuring.",
)
@click.pass_context
def performance(
    context: click.Context,
    mitsuba: str | None,
    cycles: str | None,
    against: str | None,
    minutes: float | None,
    rough: bool,
    output: Path,
    readme: Path,
    measured: Path | None,
) -> int:
    """The tables of performance.md and of the README, between their markers, from all of tools/bench.py.

    What cannot be measured on a machine, for want of Mitsuba or embreex, is left out of the table, and said
    there and at the end. The exit status is 1 where anything is left out or an aim is missed.
    """
    if rough and (output == PERFORMANCE or readme == README):
        raise click.UsageError("rough figures are not for the documentation: give --output and --readme")
    enclosed(output)  # told now, not after the measurements
    between(readme.read_text(encoding="utf-8"), *IN_README, readme.name)
    if measured:
        figures = json.loads(measured.read_text(encoding="utf-8"))
    else:
        _, figures = context.invoke(
            bench.everything, mitsuba=mitsuba, cycles=cycles, against=against, minutes=minutes, rough=rough
        )
    before, after = enclosed(output)  # as it is by now
    write(output, f"{before}\n{performance_part(figures)}\n{after}")
    if "scenes" in figures:
        before, after = between(readme.read_text(encoding="utf-8"), *IN_README, readme.name)
        write(readme, "\n".join([before, "", *overview(figures["scenes"]), "", after]))
    return max(judge(bench.rows(figures)), bench.say_left_out(figures))


@main.command()
@output_option(COMMAND_LINE)
def profile(output: Path) -> None:
    """The profile in command-line.md, between its markers, by the command that stands before it."""
    before, after = between(output.read_text(encoding="utf-8"), *PROFILE, output.name)
    words = shlex.split(before.rsplit("```", 2)[1])
    with tempfile.TemporaryDirectory() as folder:
        written = {name: str(Path(folder) / name) for name in ("room.exr", "room.json")}
        words = [written.get(word, word) for word in words[1:]]
        command = [sys.executable, "-m", "clvol.cli.main", *words, "--quiet"]
        printed = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    write(output, f"{before}\n```\n{textwrap.dedent(printed)}```\n{after}")


@main.command()
@output_option(ARCHITECTURE)
def transitions(output: Path) -> None:
    """The table of architecture.md, between its markers, from the contracts of the stages."""
    before, after = between(output.read_text(encoding="utf-8"), *TRANSITIONS, output.name)
    write(output, f"{before}\n{transitions_part()}\n{after}")


@main.command()
@click.option(
    "--figures",
    default=hard_cases.FIGURES,
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Keeps what is measured, docs/hard-cases.jsonl by default; what it has is not measured again.",
)
@click.option(
    "--group", "groups", multiple=True, type=click.Choice(list(hard_cases.GROUPS)), help="Only these cases."
)
@click.option(
    "--mitsuba", metavar="PYTHON", help="A Python with Mitsuba 3.9 and NumPy, to render cases in it too."
)
@output_option(DOCS / "hard-cases.md")
def hard(figures: Path, groups: tuple[str, ...], mitsuba: str | None, output: Path) -> int:
    """The page of hard cases: each in every way, some hours in all.

    The exit status is 1 where a case was wrong in any way.
    """
    found = hard_cases.measured(hard_cases.chosen(groups), figures)
    if mitsuba:
        hard_mitsuba.measure(mitsuba, hard_cases.chosen(groups))
    write(output, hard_cases.page(found))
    return 1 if any(one.wrong for one in found.values()) else 0


@main.command()
@click.argument("names", nargs=-1, type=click.Choice(list(RECIPES)))
def recipes(names: tuple[str, ...]) -> None:
    """The plots and tables of recipes.md, or only those NAMES, by tools/recipe.py."""
    for name in names or RECIPES:
        markers = f"<!-- {name}: written by tools/docs.py -->", f"<!-- end of {name} -->"
        before, after = between(RECIPES_PAGE.read_text(encoding="utf-8"), *markers, RECIPES_PAGE.name)
        found = import_module(f"recipes.{name}").run(DOCS / "pictures" / f"recipe-{name}.png", quick=False)
        write(RECIPES_PAGE, f"{before}\n\n{found}\n\n{after}")


@main.command("all")
@mitsuba_option
@click.pass_context
def everything(context: click.Context, mitsuba: str | None) -> int:
    """Everything: pictures, profile, techniques, pilot, recipes, performance, in about an hour on two cores.

    Figures are of a machine that does nothing else meanwhile. The exit status is 1 where one of the parts
    says so.
    """
    enclosed(PERFORMANCE)
    status = 0
    parts = (
        (pictures, {}),
        (profile, {}),
        (techniques, {}),
        (pilot, {}),
        (recipes, {}),
        (performance, {"mitsuba": mitsuba}),
    )
    for part, options in parts:
        started = time.monotonic()
        status = max(status, context.invoke(part, **options) or 0)
        click.echo(f"{part.name}: {(time.monotonic() - started) / 60:.0f} minutes", err=True)
    return status


if __name__ == "__main__":
    main()
