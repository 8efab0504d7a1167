"""Efficiency of clvol beside Mitsuba's: both render the same scene by turns, in CPU time."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import numpy as np
from scene_options import open_scene

from benchmarks.efficiency import (
    Rounds,
    efficiencies,
    efficiency_ratio,
    image_mean,
    pixel_variance,
    spread,
    z_score,
)
from benchmarks.mitsuba_side import REQUIREMENT, MitsubaSide, mitsuba_python
from benchmarks.tables import Figures, Row, Unavailable, at_least, ranged, show, thread_count
from clvol.version import __version__

EFFICIENCY_TARGET = 8.0
Z_LIMIT = 4.0
"""Two correct programs differ by more in one run of 16,000."""


def mitsuba_here(given: str | None) -> str:
    """The Python that has Mitsuba; Unavailable where none was given and none can be installed."""
    try:
        python = mitsuba_python(given)
    except (subprocess.CalledProcessError, OSError):
        raise Unavailable(f"no {REQUIREMENT} to be had", "give --mitsuba PYTHON") from None
    if not has_mitsuba(python):
        hint = f"{python} cannot import mitsuba and numpy: give --mitsuba PYTHON"
        raise Unavailable(f"no {REQUIREMENT} that works", hint)
    return python


def has_mitsuba(python: str) -> bool:
    """Whether a Python has what the worker needs."""
    try:
        return not subprocess.run([python, "-c", "import mitsuba, numpy"], capture_output=True).returncode
    except OSError:
        return False


def samples_for(seconds: float, trial_spp: int, trial_seconds: float) -> int:
    """Samples per pixel that take about `seconds`."""
    return max(2, round(trial_spp * seconds / trial_seconds))


def measure_cloud(
    scene: str,
    res: int,
    rounds: int,
    seconds: float,
    python: str,
    choices: dict[str, str],
    device: str | None,
) -> Figures:
    """Render by turns; efficiency, means and their difference."""
    cpu = time.process_time()
    opened = open_scene(scene, {"res": res}, choices, device)
    setup_cpu = time.process_time() - cpu
    opened.render(1, 0)  # the first launch finishes the kernels' build
    spp = samples_for(seconds, 16, opened.render(16, 0).wall)
    ours, theirs = [], []
    own_variance = []
    with MitsubaSide(python, scene, {"res": str(res)}, thread_count()) as mitsuba:
        mitsuba.render(1, 0)
        mitsuba_spp = samples_for(seconds, 4, mitsuba.render(4, 0)[2])
        for seed in range(1, rounds + 1):
            result, cpu, _ = opened.render(spp, seed)
            ours.append((result.image, cpu))
            own_variance.append(float(result.variance.mean(dtype=np.float64)) * spp)
            theirs.append(mitsuba.render(mitsuba_spp, seed)[:2])
    sides = {"clvol": Rounds.of(ours, spp), "mitsuba": Rounds.of(theirs, mitsuba_spp)}
    figures: Figures = {name: _side_figures(side) for name, side in sides.items()}
    figures["clvol"] |= {"version": __version__, "setup_cpu": setup_cpu}
    figures["clvol"]["variance_by_pixel"] = float(np.mean(own_variance))
    figures["mitsuba"] |= {"version": mitsuba.version, "setup_cpu": mitsuba.load_cpu}
    means = [(figures[name]["mean"], figures[name]["standard_error"]) for name in sides]
    return figures | {
        "scene": Path(scene).name,
        "res": res,
        "rounds": rounds,
        "ratio": efficiency_ratio(sides["clvol"], sides["mitsuba"]),
        "z": z_score(*means),
    }


def _side_figures(side: Rounds) -> Figures:
    mean, error = image_mean(side)
    return {
        "spp": side.spp,
        "mean": mean,
        "standard_error": error,
        "variance": float(pixel_variance(side).mean()),
        "cpu": spread(side.cpu),
        "microseconds_per_path": spread(1e6 * side.cpu / side.paths),
        "efficiency": spread(efficiencies(side)),
    }


def show_cloud(figures: Figures, name: str = "cloud") -> None:
    """Both sides, and the ratio's interval."""
    sides = [figures["clvol"], figures["mitsuba"]]
    rows = [
        ("samples per pixel and round", *(str(s["spp"]) for s in sides)),
        ("CPU seconds of a round", *(ranged(s["cpu"]) for s in sides)),
        ("CPU microseconds per path", *(ranged(s["microseconds_per_path"]) for s in sides)),
        ("variance per sample, between rounds", *(f"{s['variance']:.5f}" for s in sides)),
        ("  as the program itself estimates it", f"{sides[0]['variance_by_pixel']:.5f}", "-"),
        ("efficiency, 1 / (variance x CPU s)", *(ranged(s["efficiency"], 4) for s in sides)),
        ("mean of the image", *(f"{s['mean']:.6f} ± {s['standard_error']:.6f}" for s in sides)),
        ("CPU seconds to load and prepare, once", *(f"{s['setup_cpu']:.2f}" for s in sides)),
    ]
    names = [f"clvol {sides[0]['version']}", f"Mitsuba {sides[1]['version']} scalar_rgb"]
    show(f"{name}: {figures['rounds']} rounds by turns, {thread_count()} threads", ["", *names], rows)
    ratio = figures["ratio"]
    print(
        f"efficiency, clvol over Mitsuba: {ranged(ratio)} over rounds, 95 % interval {ratio['low']:.3g} to "
        f"{ratio['high']:.3g}; difference of the means: z = {figures['z']:+.2f}"
    )


def cloud_rows(figures: Figures) -> list[Row]:
    """The ratio, and both means."""
    ours, theirs, ratio, res = (figures[name] for name in ("clvol", "mitsuba", "ratio", "res"))
    means = [f"{side['mean']:.5f} ± {side['standard_error']:.5f}" for side in (ours, theirs)]
    return [
        at_least(
            f"efficiency on `{figures['scene']}`, {res} × {res}, over Mitsuba {theirs['version']} "
            "`scalar_rgb`: 1 / (variance × CPU time)",
            f"{ranged(ratio)} times, with {ours['spp']} samples a pixel a render",
            EFFICIENCY_TARGET,
            ratio["median"],
        ),
        Row(
            "both means ± standard error",
            f"{means[0]}, Mitsuba {means[1]}: {abs(figures['z']):.1f} standard errors apart",
            f"agree within {Z_LIMIT:g} standard errors",
            agrees(figures),
        ),
    ]


def agrees(figures: Figures) -> bool:
    """Whether the two means differ by less than Z_LIMIT standard errors."""
    return abs(figures["z"]) < Z_LIMIT
