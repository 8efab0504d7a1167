"""The commands that measure the benchmark's scenes: beside others, and as curves."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click
from documents import writable
from folders import ROOT
from scene_options import choice_options

from benchmarks.curves import AXES, measure_curve, plot_curve, show_curve
from benchmarks.options import (
    asked,
    bench_scene_option,
    json_option,
    peer_options,
    res_option,
    rounds_option,
    seconds_option,
    threads_option,
)
from benchmarks.peers import AGAINST, CLVOL, CYCLES, MITSUBA, clvol_of, other_program, sources_of
from benchmarks.scene_efficiency import measure_scenes
from benchmarks.scene_tables import show_scenes
from benchmarks.scenes import SCENES
from clvol.base.extras import need_matplotlib

if TYPE_CHECKING:
    from benchmarks.tables import Outcome


@click.command()
@click.option(
    "--scene", "names", type=click.Choice(list(SCENES)), multiple=True, help="One of them; repeatable."
)
@peer_options
@res_option
@rounds_option(5)
@seconds_option
@threads_option
@click.option(
    "--shrink", type=click.IntRange(1, 8), default=1, help="Divide the grids' edges by this, to try it."
)
@choice_options
@json_option
def scenes(
    names: tuple[str, ...],
    mitsuba: str | None,
    cycles: str | None,
    against: str | None,
    res: int,
    rounds: int,
    seconds: float,
    threads: int,
    shrink: int,
    device: str | None,
    json_path: Path | None,
    **choices: str,
) -> Outcome:
    """Efficiency on six scenes, beside Mitsuba, Cycles and an old commit where these are given, by turns.

    Set-up is kept apart. Exit 1 if pictures differ, or clvol leads the others by less than it should.
    """
    options = asked(choices, device)
    peers = [clvol_of(ROOT, CLVOL, "clvol", options)]
    peers += [
        other_program(kind, python) for kind, python in ((MITSUBA, mitsuba), (CYCLES, cycles)) if python
    ]
    with ExitStack() as stack:
        if against:
            sources = stack.enter_context(sources_of(against))
            peers.append(clvol_of(sources, AGAINST, f"clvol {against}", options))
        figures = measure_scenes(
            names or list(SCENES),
            peers,
            res=res,
            rounds=rounds,
            seconds=seconds,
            threads=threads,
            shrink=shrink,
        )
    show_scenes(figures)
    return json_path, {"scenes": figures}


@click.command()
@click.argument("axis", type=click.Choice(list(AXES)))
@bench_scene_option
@click.option("--at", "values", type=click.IntRange(min=1), multiple=True, help="A value; repeatable.")
@click.option("--samples", type=click.IntRange(min=1), help="Of a picture, over all pixels.")
@rounds_option(3)
@threads_option
@click.option("--rough", is_flag=True, help="Only try it: the figures mean nothing.")
@click.option("--plot", type=click.Path(path_type=Path), callback=writable, metavar="FILE", help="Draw it.")
@choice_options
@json_option
def curve(
    axis: str,
    scene: str,
    values: tuple[int, ...],
    samples: int | None,
    rounds: int,
    threads: int,
    rough: bool,
    plot: Path | None,
    device: str | None,
    json_path: Path | None,
    **choices: str,
) -> Outcome:
    """How time, memory and error grow with the film, the grid, the threads or the samples."""
    if plot:
        need_matplotlib("a plot")
    if rough:
        values, samples, rounds = values or AXES[axis].values[:2], samples or 1 << 12, 2
    figures = measure_curve(axis, scene, values, rounds, threads, samples, asked(choices, device))
    show_curve(figures)
    if plot:
        plot_curve(figures, plot)
    return json_path, {f"curve {axis}": figures}
