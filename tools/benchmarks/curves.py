"""How a render's time, memory and error grow: with the film, the grid, the threads, and the samples."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from folders import ROOT

from benchmarks.efficiency import Rounds, pixel_variance, spread
from benchmarks.peers import CLVOL, clvol_of
from benchmarks.scenes import SCENES, write_scene
from benchmarks.tables import Figures, show
from clvol.base.extras import need_matplotlib

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.worker import Rendered

SAMPLES = 1 << 22
"""Of a picture, over all pixels, where neither the film nor the samples are what grows."""


@dataclass(frozen=True)
class Axis:
    """What grows along a curve, and what else a picture has.

    unit : of its values.  values : where it is measured.  samples : of a picture, over all pixels.
    """

    unit: str
    values: tuple[int, ...]
    samples: int = SAMPLES


AXES = {
    "film": Axis("pixels along an edge", (64, 128, 256, 512, 1024, 2048)),
    "grid": Axis("voxels along an edge", (32, 64, 128, 256, 512), SAMPLES // 4),
    "threads": Axis("threads", (1, 2)),
    "samples": Axis("samples a pixel", tuple(2**power for power in range(11))),
}
RES = 128
COLUMNS = {
    "seconds": "seconds",
    "microseconds": "µs of the clock a sample",
    "cpu_microseconds": "CPU µs a sample, set-up too",
    "setup": "set-up, seconds",
    "memory": "peak memory, MiB",
    "error": "relative error",
}


def measure_curve(
    axis: str,
    scene: str,
    values: Sequence[int] | None,
    rounds: int,
    threads: int,
    samples: int | None = None,
    options: dict[str, str] | None = None,
) -> Figures:
    """A point for each value, each in a process of its own.

    samples : of a picture over all pixels, instead of the axis' own.
    """
    samples = samples or AXES[axis].samples
    points = {}
    for value in values or AXES[axis].values:
        points[str(value)] = _point(axis, scene, value, rounds, threads, samples, options or {})
        click.echo(f"{axis} {value}: measured", err=True)
    return {"axis": axis, "scene": scene, "rounds": rounds, "threads": threads, "points": points}


def _point(
    axis: str, name: str, value: int, rounds: int, threads: int, samples: int, options: dict[str, str]
) -> Figures:
    scene = SCENES[name]
    if axis == "grid":
        scene = replace(scene, volume="rough", size=value)
    res = value if axis == "film" else RES
    spp = value if axis == "samples" else max(samples // res**2, 1)
    peer = clvol_of(ROOT, CLVOL, "clvol", options)
    with tempfile.TemporaryDirectory(prefix="clvol-bench-") as folder:
        path = write_scene(scene, Path(folder))
        with peer.open(path, res, value if axis == "threads" else threads) as worker:
            worker.render(1, 0)  # builds kernels
            renders = [worker.render(spp, seed) for seed in range(1, rounds + 1)]
    return _figures(renders, res, spp)


def _figures(renders: list[Rendered], res: int, spp: int) -> Figures:
    paths = spp * res**2
    seconds = np.array([one.stats["seconds"]["render"] for one in renders])
    setup = np.array([one.stats["seconds"]["setup"] for one in renders])
    cpu = np.array([one.cpu for one in renders])
    rounds = Rounds(np.stack([one.image for one in renders]), cpu, spp)
    variance = float(pixel_variance(rounds).mean()) / spp
    return {
        "spp": spp,
        "res": res,
        "seconds": spread(seconds),
        "microseconds": spread(1e6 * seconds / paths),
        "cpu_microseconds": spread(1e6 * cpu / paths),
        "setup": spread(setup),
        "memory": spread([one.stats["peak_bytes"] / 2**20 for one in renders]),
        "error": spread([np.sqrt(variance) / float(rounds.images.mean())]),
        "lookups": float(np.mean([one.stats["lookups"] for one in renders])) / paths,
    }


def show_curve(figures: Figures) -> None:
    """A row for each point, of medians; their ranges are in the figures."""
    axis = AXES[figures["axis"]]
    rows = [
        (value, str(point["spp"]), *(f"{point[name]['median']:.3g}" for name in COLUMNS))
        for value, point in figures["points"].items()
    ]
    title = f"{figures['axis']}: scene {figures['scene']}, medians of {figures['rounds']} rounds"
    show(title, [axis.unit, "spp", *COLUMNS.values()], rows)


PANELS = {
    "film": ("microseconds", "memory"),
    "grid": ("microseconds", "setup", "memory"),
    "threads": ("seconds", "cpu_microseconds"),
    "samples": ("error", "seconds"),
}
"""What is drawn over each axis."""


def plot_curve(figures: Figures, path: Path) -> None:
    """Draw a curve, with the range over the rounds, to a picture of the kind that the path's suffix says."""
    need_matplotlib("a plot")
    from matplotlib.figure import Figure

    from clvol.lab.colours import BLUE

    names, values = PANELS[figures["axis"]], [int(value) for value in figures["points"]]
    drawing = Figure(figsize=(3.6 * len(names), 3.2), layout="constrained")
    for axes, name in zip(drawing.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        points: list[dict[str, Any]] = [point[name] for point in figures["points"].values()]
        axes.plot(values, [point["median"] for point in points], "o-", color=BLUE)
        low, high = ([point[key] for point in points] for key in ("least", "greatest"))
        axes.fill_between(values, low, high, color=BLUE, alpha=0.25, linewidth=0)
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.set(xlabel=AXES[figures["axis"]].unit, ylabel=COLUMNS[name], xticks=values)
        axes.set_xticks(values, [str(value) for value in values], rotation=45)
        axes.grid(True, color="#e4e4e4", linewidth=0.7)
    drawing.savefig(path)
