"""Options of the benchmark's commands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from documents import writable
from scene_options import choice_options

from benchmarks import cloud

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
