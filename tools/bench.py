"""The figures of docs/performance.md, measured.

    python tools/bench.py cloud --mitsuba /path/to/mitsuba-environment/bin/python
    python tools/bench.py scenes --cycles /path/to/bpy-environment/bin/python --against main~20
    python tools/bench.py curve film --plot film.svg
    python tools/bench.py all --minutes 30 --json figures.json

Nothing here is a test: figures depend on the machine and on what else runs on it.  So a figure is a median
with its least and greatest value, and what is compared takes turns.  The exit status is 1 where an aim is
missed or, of `all`, something could not be measured.  `tools/docs.py performance` writes them into
docs/performance.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import click
from benchmarks import chromatic, scaling
from benchmarks.cloud import cloud_rows, measure_cloud, mitsuba_here, show_cloud
from benchmarks.costs import (
    load_rows,
    measure_load,
    measure_memory,
    measure_startup,
    memory_rows,
    show_load,
    show_memory,
    show_startup,
    startup_rows,
)
from benchmarks.mitsuba_side import cached_mitsuba
from benchmarks.options import efficiency_options, json_option, mitsuba_option, rounds_option, size_option
from benchmarks.pool import measure_pool, show_pool
from benchmarks.rays import EDGE, SIZES, measure_rays, ray_rows, show_rays
from benchmarks.room import ROOM, measure_room, room_rows, show_room
from benchmarks.scene_commands import curve, scenes
from benchmarks.scene_tables import scene_rows
from benchmarks.scenes import SCENES
from benchmarks.tables import Figures, Outcome, Row, Unavailable, judge, save
from folders import SCENES as FOLDER
from scene_options import choice_options, open_scene

from clvol.cli.messages import OneLineErrors

if TYPE_CHECKING:
    from pathlib import Path

CLOUD = str(FOLDER / "cloud.xml")
POOL_SIZES = (2048, 8192, 32768)
ROWS: dict[str, Callable[[Figures], list[Row]]] = {
    "cloud": cloud_rows,
    "room": room_rows,
    "scenes": scene_rows,
    "rays": ray_rows,
    "startup": startup_rows,
    "load": load_rows,
    "memory": memory_rows,
    "chromatic": chromatic.chromatic_rows,
    "scaling": scaling.scaling_rows,
}
"""The table's rows of each command's figures."""
ROUGH: dict[str, dict[str, object]] = {
    "cloud": {"res": 16, "seconds": 0.2, "rounds": 2},
    "room": {"res": 16, "seconds": 0.2, "rounds": 2},
    "scenes": {"res": 16, "seconds": 0.1, "rounds": 2, "shrink": 4},
    "rays": {"triangles": (1000, 3000), "edge": 64, "rounds": 2},
    "startup": {"rounds": 1},
    "load": {"size": 32, "rounds": 1},
    "memory": {"size": 64},
    "pool": {"sizes": (2048,), "spp": 1, "rounds": 1},
    "chromatic": {"res": 16, "spp": 4, "rounds": 2},
}
"""What each command takes to be tried rather than to measure."""
LEFT_OUT = "left_out"


def rows(figures: Figures) -> list[Row]:
    """Everything that was measured, in the table's order."""
    return [row for name, of in ROWS.items() if name in figures for row in of(figures[name])]


@click.group(cls=OneLineErrors)
def main() -> None:
    """Measure clvol's speed and memory."""


@main.result_callback()
def finish(outcome: Outcome) -> int:
    """Write the figures where asked to, and print them beside their aims.

    The exit status is 1 where one is missed or could not be measured; both are said on standard error.
    """
    json_path, figures = outcome
    save(json_path, figures)
    return max(judge(rows(figures)), say_left_out(figures))


def say_left_out(figures: Figures) -> int:
    """On standard error, what could not be measured; the exit status: 1 if anything."""
    for name, reason in figures.get(LEFT_OUT, {}).items():
        click.echo(f"LEFT OUT: {name}: {reason}", err=True)
    return 1 if figures.get(LEFT_OUT) else 0


Measure = Callable[[str, int, int, float, str, dict[str, str], str | None], Figures]
"""Takes scene, res, rounds, seconds, Mitsuba's Python, choices and device."""


def beside_mitsuba(
    name: str, scene: str, measure: Measure, show: Callable[[Figures], None], text: str
) -> click.Command:
    """A command that compares with Mitsuba on a scene."""

    @main.command(name, help=text)
    @efficiency_options(scene)
    def command(
        mitsuba: str | None,
        scene: str,
        res: int,
        rounds: int,
        seconds: float,
        device: str | None,
        json_path: Path | None,
        **choices: str,
    ) -> Outcome:
        figures = measure(scene, res, rounds, seconds, mitsuba_here(mitsuba), choices, device)
        show(figures)
        return json_path, {name: figures}

    return command


cloud = beside_mitsuba(
    "cloud",
    CLOUD,
    measure_cloud,
    show_cloud,
    "Efficiency beside Mitsuba's, by turns, in CPU time; exit 1 if the pictures differ.",
)
room = beside_mitsuba(
    "room",
    ROOM,
    measure_room,
    show_room,
    "The same in a room of smoke and glass, and the time of each stage.",
)


@main.command()
@click.option(
    "--triangles", type=click.IntRange(min=100), multiple=True, help="Of a mesh, about; repeatable."
)
@click.option("--edge", type=click.IntRange(min=1), default=EDGE, help="Its square: the rays.")
@rounds_option(5)
@json_option
def rays(triangles: tuple[int, ...], edge: int, rounds: int, json_path: Path | None) -> Outcome:
    """Rays per second beside Embree's on one thread, and what building the hierarchy costs.

    Exit 1 if less than 0.999 of the rays hit the same triangle on both sides. Our time is the kernel's,
    Embree's that of its call from Python with the copying of rays and hits.
    """
    figures = measure_rays(rounds, triangles or SIZES, edge)
    show_rays(figures)
    return json_path, {"rays": figures}


@main.command()
@rounds_option(3)
@json_option
def startup(rounds: int, json_path: Path | None) -> Outcome:
    """Time to first pixel of `clvol render`, with cold and with warm kernel caches."""
    figures = measure_startup(rounds)
    show_startup(figures)
    return json_path, {"startup": figures}


@main.command()
@size_option(256)
@rounds_option(3)
@json_option
def load(size: int, rounds: int, json_path: Path | None) -> Outcome:
    """Time to load a grid and build its bricks and majorants."""
    figures = measure_load(size, rounds)
    show_load(figures)
    return json_path, {"load": figures}


@main.command()
@size_option(512)
@json_option
def memory(size: int, json_path: Path | None) -> Outcome:
    """Peak memory with a large grid, as a multiple of the grid."""
    figures = measure_memory(size)
    show_memory(figures)
    return json_path, {"memory": figures}


@main.command()
@click.argument("scene", metavar="[SCENE]", default=CLOUD)
@click.option("--slots", "sizes", type=click.IntRange(min=1), multiple=True, help="A pool size; repeatable.")
@click.option("--spp", type=click.IntRange(min=1), default=32, show_default=True)
@rounds_option(3)
@choice_options
@json_option
def pool(
    scene: str,
    sizes: tuple[int, ...],
    spp: int,
    rounds: int,
    device: str | None,
    json_path: Path | None,
    **choices: str,
) -> Outcome:
    """Time per stage, launches and memory for several pool sizes."""
    opened = open_scene(scene, {}, choices, device)
    figures = measure_pool(opened, list(sizes or POOL_SIZES), spp, rounds)
    show_pool(figures)
    return json_path, {"pool": figures}


main.add_command(chromatic.main, "chromatic")
main.add_command(scenes)
main.add_command(curve)
main.add_command(scaling.main, "scaling")


def rough_option(command: Callable) -> Callable:
    """--rough."""
    text = "Only try everything, at the least sizes: the figures mean nothing."
    return click.option("--rough", is_flag=True, help=text)(command)


def all_options(command: Callable) -> Callable:
    """Options of all measurements together."""
    minutes = click.option(
        "--minutes", type=float, help="Of what takes turns, together; as long as each does itself by default."
    )
    cycles = click.option("--cycles", metavar="PYTHON", help="A Python that has bpy 5, Blender's module.")
    against = click.option("--against", metavar="REV", help="Compare with clvol as it was at this commit.")
    return mitsuba_option(cycles(against(minutes(rough_option(command)))))


def turn_seconds(minutes: float, sides: int) -> float:
    """Length of a turn where all turns together, of five rounds each, take so long."""
    turns = 5 * (2 + 2 + sides * len(SCENES))
    return 60 * minutes / turns


@main.command("all")
@all_options
@json_option
@click.pass_context
def everything(
    context: click.Context,
    mitsuba: str | None,
    cycles: str | None,
    against: str | None,
    minutes: float | None,
    rough: bool,
    json_path: Path | None,
) -> Outcome:
    """Every figure but the curves, one after the other: a quarter of an hour, or as long as you say.

    What there is nothing to compare with on this machine is left out, and said at the end.
    """
    figures: Figures = {}
    left_out: dict[str, str] = {}
    for command in (cloud, room, scenes, rays, startup, load, memory, chromatic.main, pool):
        name = "chromatic" if command is chromatic.main else command.name
        arguments = dict(ROUGH[name]) if rough else {}
        if command in (cloud, room, scenes):
            arguments["mitsuba"] = mitsuba
            if minutes and not rough:
                arguments["seconds"] = turn_seconds(minutes, 2 + bool(cycles) + bool(against))
        if command is scenes:
            arguments |= {"cycles": cycles, "against": against, "mitsuba": mitsuba or cached_mitsuba()}
        try:
            figures |= context.invoke(command, **arguments)[1]
        except Unavailable as error:
            left_out[name] = error.message
            click.echo(f"{name}: {error.format_message()}", err=True)
    return json_path, figures | ({LEFT_OUT: left_out} if left_out else {})


if __name__ == "__main__":
    main()
