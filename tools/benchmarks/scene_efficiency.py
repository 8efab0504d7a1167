"""Efficiency on the benchmark's scenes: clvol, and whoever is given beside it, by turns.

Set-up is kept apart: its share of a render is what a picture of one sample costs, and what remains is that of
the other samples.  Efficiency is 1 / (variance of a sample x CPU seconds of a sample), with the variance
between rounds of independent seeds.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from benchmarks.efficiency import (
    Rounds,
    efficiencies,
    efficiency_ratio,
    image_mean,
    pixel_variance,
    spread,
    z_score,
)
from benchmarks.peers import AGAINST, CLVOL
from benchmarks.processes import output_of
from benchmarks.scenes import SCENES, write_scene
from benchmarks.worker import Rendered

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.peers import Peer
    from benchmarks.tables import Figures
    from benchmarks.worker import Worker

FIXED_ROUNDS = 3
TRIAL_SHARE = 0.1
"""Of a turn: how long a trial must take to say how many samples fill one."""
MOST_SAMPLES = 1 << 14
COUNTED = ("lookups", "cells_crossed", "shadow_rays", "real_collisions")


class Side:
    """A peer with one scene loaded, and its renders.

    Attributes
    ----------
    first : wall seconds from its start to a first picture of one sample.
    fixed_cpu, fixed_wall : of a picture of one sample, once it has rendered before.
    spp : samples of a turn, a power of two.
    """

    def __init__(self, peer: Peer, worker: Worker, started: float) -> None:
        self.peer, self.worker = peer, worker
        worker.render(1, 0)
        self.first = time.perf_counter() - started
        singles = [worker.render(1, seed) for seed in range(FIXED_ROUNDS)]
        self.fixed_cpu = float(np.median([single.cpu for single in singles]))
        self.fixed_wall = float(np.median([single.wall for single in singles]))
        self.spp, self.renders = 0, list[Rendered]()

    def fill(self, cpu_seconds: float) -> None:
        """Choose the samples of a turn."""
        spp, each = 4, 0.0
        while each * spp < TRIAL_SHARE * cpu_seconds and spp < MOST_SAMPLES:
            spp *= 4
            each = (self.worker.render(spp, 0).cpu - self.fixed_cpu) / (spp - 1)
        wanted = max(cpu_seconds / max(each, 1e-9), 2.0)
        self.spp = min(2 ** round(np.log2(wanted)), MOST_SAMPLES)

    def turn(self, seed: int) -> None:
        """Render once."""
        self.renders.append(self.worker.render(self.spp, seed))

    @property
    def rounds(self) -> Rounds:
        """Pictures, and CPU seconds without what a picture costs whatever its samples."""
        share = self.spp / (self.spp - 1)
        costs = [max(one.cpu - self.fixed_cpu, 1e-9) * share for one in self.renders]
        return Rounds.of([(one.image, cost) for one, cost in zip(self.renders, costs, strict=True)], self.spp)


def measure_scenes(
    names: Sequence[str],
    peers: Sequence[Peer],
    *,
    res: int,
    rounds: int,
    seconds: float,
    threads: int,
    shrink: int = 1,
) -> Figures:
    """Every scene by all peers that can render it, clvol first.

    seconds : of a turn, about.  shrink : divides the grids' edges, to try it.
    """
    figures: Figures = {"bare_loop": bare_loop(threads), "res": res, "rounds": rounds, "threads": threads}
    figures["scenes"] = {}
    for name in names:
        with tempfile.TemporaryDirectory(prefix="clvol-bench-") as folder:
            scene = SCENES[name]
            path = write_scene(scene, Path(folder), scene.size // shrink)
            taking_part = [peer for peer in peers if peer.renders(scene)]
            sides = _take_turns(taking_part, path, res, rounds, seconds, threads)
        measured = {side.peer.kind: side_figures(side, figures["bare_loop"]) for side in sides}
        figures["scenes"][name] = {
            "letter": scene.letter,
            "about": scene.about,
            "sides": measured,
            "over": {s.peer.kind: efficiency_ratio(sides[0].rounds, s.rounds) for s in sides[1:]},
            "z": {s.peer.kind: _apart(measured[CLVOL], measured[s.peer.kind]) for s in sides[1:]},
        }
        click.echo(f"{scene.letter} {name}: measured", err=True)
    return figures


def _take_turns(
    peers: Sequence[Peer], path: Path, res: int, rounds: int, seconds: float, threads: int
) -> list[Side]:
    """All sides' renders; every second round goes the other way."""
    with ExitStack() as stack:
        sides = []
        for peer in peers:
            started = time.perf_counter()
            worker = stack.enter_context(peer.open(path, res, threads))
            sides.append(Side(peer, worker, started))
        for side in sides:
            side.fill(seconds * threads)
        for side in sides:  # the noise of a low-discrepancy sample goes by their number
            side.spp = sides[0].spp if side.peer.kind == AGAINST else side.spp
        for number in range(rounds):
            for side in sides if number % 2 == 0 else reversed(sides):
                side.turn(number + 1)
    return sides


def bare_loop(threads: int) -> float:
    """Steps of the bare loop that a CPU second is enough for."""
    return float(output_of("bare_loop", environment={"POCL_MAX_PTHREAD_COUNT": str(threads)}))


def _apart(ours: Figures, theirs: Figures) -> float:
    return z_score(*((side["mean"], side["standard_error"]) for side in (ours, theirs)))


def side_figures(side: Side, bare: float) -> Figures:
    """What one side's renders come to."""
    rounds = side.rounds
    mean, error = image_mean(rounds)
    figures: Figures = {
        "label": side.peer.label if side.peer.kind == AGAINST else f"{side.peer.label} {side.worker.version}",
        "spp": side.spp,
        "first_seconds": side.first,
        "setup_wall": side.fixed_wall,
        "setup_cpu": side.fixed_cpu,
        "mean": mean,
        "standard_error": error,
        "variance": float(pixel_variance(rounds).mean()),
        "microseconds": spread(1e6 * rounds.cpu / rounds.paths),
        "efficiency": spread(efficiencies(rounds)),
        "cpu": [one.cpu for one in side.renders],
        "wall": [one.wall for one in side.renders],
    }
    return figures | counted(side, bare)


def counted(side: Side, bare: float) -> Figures:
    """What clvol counts: per sample, seconds of stages per sample, and look-ups beside the bare loop."""
    stats = [one.stats for one in side.renders]
    if not stats[0]:
        return {}
    rounds = side.rounds
    figures: dict[str, Any] = {
        name: float(np.mean([s[name] for s in stats])) / rounds.paths for name in COUNTED if name in stats[0]
    }
    parts = {name for name in stats[0]["seconds"] if name not in ("setup", "kernels", "render")}
    figures["stages"] = {
        name: 1e6 * float(np.median([s["seconds"][name] for s in stats])) / rounds.paths
        for name in stats[0]["seconds"]
        if name in parts
    }
    shares = [
        sum(s["seconds"][n] for n in parts - {"accumulate"}) / max(s["seconds"]["render"], 1e-9)
        for s in stats
    ]
    figures["outside_share"] = 1 - float(np.median(shares))
    if "lookups" in figures:
        figures["lookups_per_second"] = figures["lookups"] * rounds.paths / float(np.median(rounds.cpu))
        figures["share_of_bare_loop"] = figures["lookups_per_second"] / bare
    figures["choices"] = stats[0].get("metadata", {})
    return figures
