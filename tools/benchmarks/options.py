"""Options of the benchmark's commands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from documents import writable
from scene_options import choice_options

from benchmarks import cloud
from benchmarks.scenes import SCENES
from benchmarks.tables import thread_count

if TYPE_CHECKING:
    from collections.abc import Callable


def json_option(command: Callable) -> Callable:
    """--json FILE."""
    option = click.option(
        "--json",
        "json_path",
        type=click.Path(path_type=Path),
        callback=writable,
        metavar="FILE",
        help="Write the figures too.",
    )
    return option(command)


def rounds_option(default: int) -> Callable:
    """--rounds N, at least 2: a spread needs them."""
    return click.option("--rounds", type=click.IntRange(min=2), default=default, show_default=True)


def size_option(default: int) -> Callable:
    """--size N."""
    limits = click.IntRange(min=8)
    return click.option("--size", type=limits, default=default, show_default=True, help="Voxels per axis.")


def check_mitsuba(context: click.Context, parameter: click.Parameter, python: str | None) -> str | None:
    """A Python that was given must have Mitsuba: told before anything is measured."""
    if python is not None and not cloud.has_mitsuba(python):
        raise click.BadParameter(f"{python} is no Python that can import mitsuba and numpy")
    return python


mitsuba_option = click.option(
    "--mitsuba",
    callback=check_mitsuba,
    metavar="PYTHON",
    help="A Python that has Mitsuba 3.9; without it, one is installed in a cache.",
)


res_option = click.option("--res", type=click.IntRange(min=1), default=128, show_default=True)
seconds_option = click.option(
    "--seconds", type=float, default=3.0, show_default=True, help="Length of a side's turn."
)
threads_option = click.option(
    "--threads", type=click.IntRange(min=1), default=thread_count, help="Of every side; all cores by default."
)
bench_scene_option = click.option(
    "--scene", type=click.Choice(list(SCENES)), default="cloud", show_default=True
)


def peer_options(command: Callable) -> Callable:
    """Who takes part beside clvol: --mitsuba, --cycles, --against."""
    for option in (
        click.option("--against", metavar="REV", help="clvol as it was at a commit of this repository."),
        click.option("--cycles", metavar="PYTHON", help="A Python that has bpy 5, Blender's module."),
        click.option("--mitsuba", metavar="PYTHON", help="A Python that has Mitsuba 3.9."),
    ):
        command = option(command)
    return command


def asked(choices: dict[str, str], device: str | None) -> dict[str, str]:
    """Options of `clvol.render` that were given: an old commit knows no others."""
    given = {family: name for family, name in choices.items() if name != "auto"}
    return given | ({"device": device} if device else {})


def efficiency_options(scene: str) -> Callable:
    """The options of a comparison with Mitsuba."""

    def add(command: Callable) -> Callable:
        for option in (
            json_option,
            choice_options,
            seconds_option,
            rounds_option(5),
            res_option,
            click.option("--scene", default=scene, metavar="SCENE", help="A scene that has $res."),
            mitsuba_option,
        ):
            command = option(command)
        return command

    return add
