"""The figures of the README's performance section, measured.

    python tools/bench.py cloud --mitsuba /path/to/mitsuba-environment/bin/python
    python tools/bench.py all --json figures.json

Nothing here is a test: figures depend on the machine and on what else runs on it.  So a figure is a median
with its least and greatest value, and what is compared takes turns.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bench_cloud
import bench_costs
import bench_pool
import bench_rays
import bench_room
import click
from bench_tables import Figures, save
from mitsuba_side import mitsuba_python
from scene_options import choice_options, open_scene

from clvol.cli_options import OneLineErrors

CLOUD = str(Path(__file__).resolve().parent.parent / "scenes" / "cloud.xml")
POOL_SIZES = (2048, 8192, 32768)
Outcome = tuple[str | None, Figures]
"""What a command returns: the file to write its figures to, and the figures."""


@click.group(cls=OneLineErrors)
def main() -> None:
    """Measure clvol's speed and memory."""


@main.result_callback()
def finish(outcome: Outcome) -> int:
    """Write the figures where asked to; the exit status is 1 if two programs' pictures differ."""
    json_path, figures = outcome
    save(json_path, figures)
    compared = [figures[name] for name in ("cloud", "room") if name in figures]
    return 0 if all(bench_cloud.agrees(sides) for sides in compared) else 1


def json_option(command: Callable) -> Callable:
    """--json FILE."""
    option = click.option(
        "--json", "json_path", type=click.Path(dir_okay=False), metavar="FILE", help="Write the figures too."
    )
    return option(command)


def rounds_option(default: int) -> Callable:
    """--rounds N, at least 2: a spread needs them."""
    return click.option("--rounds", type=click.IntRange(min=2), default=default, show_default=True)


def size_option(default: int) -> Callable:
    """--size N."""
    limits = click.IntRange(min=8)
    return click.option("--size", type=limits, default=default, show_default=True, help="Voxels per axis.")


mitsuba_option = click.option(
    "--mitsuba",
    metavar="PYTHON",
    help="A Python that has Mitsuba 3.9; without it, one is installed in a cache.",
)


def efficiency_options(scene: str) -> Callable:
    """The options of a comparison with Mitsuba."""

    def add(command: Callable) -> Callable:
        for option in (
            json_option,
            choice_options,
            click.option(
                "--seconds", type=float, default=3.0, show_default=True, help="Length of a side's turn."
            ),
            rounds_option(5),
            click.option("--res", type=click.IntRange(min=1), default=128, show_default=True),
            click.option("--scene", default=scene, metavar="SCENE", help="A scene that has $res."),
            mitsuba_option,
        ):
            command = option(command)
        return command

    return add


@main.command()
@efficiency_options(CLOUD)
def cloud(
    mitsuba: str | None,
    scene: str,
    res: int,
    rounds: int,
    seconds: float,
    device: str | None,
    json_path: str | None,
    **choices: str,
) -> Outcome:
    """Efficiency beside Mitsuba's, by turns, in CPU time; exit 1 if the pictures differ."""
    figures = bench_cloud.measure_cloud(scene, res, rounds, seconds, mitsuba_python(mitsuba), choices, device)
    bench_cloud.show_cloud(figures)
    return json_path, {"cloud": figures}


@main.command()
@efficiency_options(bench_room.ROOM)
def room(
    mitsuba: str | None,
    scene: str,
    res: int,
    rounds: int,
    seconds: float,
    device: str | None,
    json_path: str | None,
    **choices: str,
) -> Outcome:
    """The same in a room of smoke and glass, and the time of each stage."""
    figures = bench_room.measure_room(scene, res, rounds, seconds, mitsuba_python(mitsuba), choices, device)
    bench_room.show_room(figures)
    return json_path, {"room": figures}


@main.command()
@rounds_option(5)
@json_option
def rays(rounds: int, json_path: str | None) -> Outcome:
    """Rays per second beside Embree's on one thread, and what building the hierarchy costs."""
    figures = bench_rays.measure_rays(rounds)
    bench_rays.show_rays(figures)
    return json_path, {"rays": figures}


@main.command()
@rounds_option(3)
@json_option
def startup(rounds: int, json_path: str | None) -> Outcome:
    """Time to first pixel of `clvol render`, with cold and with warm kernel caches."""
    figures = bench_costs.measure_startup(rounds)
    bench_costs.show_startup(figures)
    return json_path, {"startup": figures}


@main.command()
@size_option(256)
@rounds_option(3)
@json_option
def load(size: int, rounds: int, json_path: str | None) -> Outcome:
    """Time to load a grid and build its bricks and majorants."""
    figures = bench_costs.measure_load(size, rounds)
    bench_costs.show_load(figures)
    return json_path, {"load": figures}


@main.command()
@size_option(512)
@json_option
def memory(size: int, json_path: str | None) -> Outcome:
    """Peak memory with a large grid, as a multiple of the grid."""
    figures = bench_costs.measure_memory(size)
    bench_costs.show_memory(figures)
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
    json_path: str | None,
    **choices: str,
) -> Outcome:
    """Time per stage, launches and memory for several pool sizes."""
    opened = open_scene(scene, {}, choices, device)
    figures = bench_pool.measure_pool(opened, list(sizes or POOL_SIZES), spp, rounds)
    bench_pool.show_pool(figures)
    return json_path, {"pool": figures}


@main.command("all")
@mitsuba_option
@json_option
@click.pass_context
def everything(context: click.Context, mitsuba: str | None, json_path: str | None) -> Outcome:
    """Every figure, one after the other, with the defaults of each command."""
    figures: Figures = {}
    for command, arguments in (
        (cloud, {"mitsuba": mitsuba}),
        (room, {"mitsuba": mitsuba}),
        (rays, {}),
        (startup, {}),
        (load, {}),
        (memory, {}),
        (pool, {}),
    ):
        figures |= context.invoke(command, **arguments)[1]
    return json_path, figures


if __name__ == "__main__":
    main()
