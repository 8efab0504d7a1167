"""How much faster several workers of a cluster are than one: renders by turns, each worker with one thread.

Workers of a turn have rendered before the clock starts: their start, kernels and tables do not count, as they
would in a render of seconds.  What is left is what ranges cost, who waits at the end, and the sums' way.
Workers of one machine share its memory and caches too.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import click
from folders import SCENES

import clvol
from benchmarks.efficiency import spread
from benchmarks.options import json_option, res_option, rounds_option
from benchmarks.tables import Figures, Outcome, Row, Unavailable, at_least, ranged, show
from clvol.cluster.ranges import LEAST_PATHS

AIM = 0.9
"""Of what as many machines could do: 1.8 for two workers."""
ONE_THREAD = {"POCL_MAX_PTHREAD_COUNT": "1"}
RENDERS = 2
"""Of a turn, of which the faster counts: another program's moment slows one of them."""


def measure_scaling(scene: str, res: int, spp: int, workers: int, rounds: int) -> Figures:
    """Wall seconds of the same render with one worker and with several, by turns."""
    check_machine(workers)
    seconds: dict[int, list[float]] = {1: [], workers: []}
    for seed in range(rounds):
        for count, taken in seconds.items():
            taken.append(turn(scene, res, spp, count, RENDERS * seed))
    return {
        "scene": Path(scene).name,
        "res": res,
        "spp": spp,
        "workers": workers,
        "seconds": {str(count): spread(taken) for count, taken in seconds.items()},
    }


def check_machine(workers: int) -> None:
    """Raise Unavailable where workers would share cores, or there is no Dask."""
    if workers > (cores := len(os.sched_getaffinity(0))):
        hint = "give --workers as many as there are cores"
        raise Unavailable(f"{workers} workers would share {cores} cores", hint)
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise Unavailable("Dask is not installed", "pip install 'clvol[cluster]'") from None


def turn(scene: str, res: int, spp: int, workers: int, seed: int) -> float:
    """Seconds of a render by workers that are new, but have rendered the scene."""
    from distributed import Client, LocalCluster

    options = {"threads_per_worker": 1, "dashboard_address": None, "env": ONE_THREAD}
    with LocalCluster(n_workers=workers, processes=True, **options) as cluster, Client(cluster) as client:
        loaded = clvol.load_file(scene, res=res)
        few = 2 * workers * -(-LEAST_PATHS // res**2)  # two ranges for each
        clvol.render(loaded, spp=min(few, spp), seed=seed + 1000, client=client)
        taken = []
        for number in range(RENDERS):
            started = time.perf_counter()
            clvol.render(loaded, spp=spp, seed=seed + number, client=client)
            taken.append(time.perf_counter() - started)
    return min(taken)


def gain(figures: Figures) -> float:
    """How many times faster several workers are, by the medians."""
    one, several = (figures["seconds"][str(count)]["median"] for count in (1, figures["workers"]))
    return float(one / several)


def show_scaling(figures: Figures) -> None:
    """One row for each number of workers."""
    one = figures["seconds"]["1"]["median"]
    rows = [
        (f"{count} worker{'' if count == '1' else 's'}", ranged(taken), f"{one / taken['median']:.2f}")
        for count, taken in figures["seconds"].items()
    ]
    name, res, spp = (figures[key] for key in ("scene", "res", "spp"))
    title = f"scaling: {name}, {res} x {res}, {spp} samples a pixel"
    show(title, ["", "seconds", "times as fast"], rows)


def scaling_rows(figures: Figures) -> list[Row]:
    """What several workers bring."""
    text = f"{figures['workers']} workers of one thread over one, {figures['spp']} samples a pixel"
    return [at_least(text, f"{gain(figures):.2f} times", AIM * figures["workers"], gain(figures))]


@click.command()
@click.option("--scene", default=str(SCENES / "cloud.xml"), metavar="SCENE", help="A scene that has $res.")
@res_option
@click.option("--spp", default=2048, show_default=True, type=click.IntRange(min=1))
@click.option("--workers", default=2, show_default=True, type=click.IntRange(min=2))
@rounds_option(3)
@json_option
def main(scene: str, res: int, spp: int, workers: int, rounds: int, json_path: Path | None) -> Outcome:
    """How many times as fast a Dask cluster of several workers is as one worker, by turns."""
    figures = measure_scaling(scene, res, spp, workers, rounds)
    show_scaling(figures)
    return json_path, {"scaling": figures}
