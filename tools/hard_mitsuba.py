"""What Mitsuba's volpath shows of the hard cases that it can read, in some seconds each.

docs/hard-cases-mitsuba.jsonl keeps what was seen, one case a line.
"""

from __future__ import annotations

import json
import pickle
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from folders import ROOT
from scipy.special import stdtr

from clvol.lab.hard.case import NOISY
from clvol.lab.hard.suite import ALPHA
from clvol.scene.records import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.lab.hard.case import Case

FIGURES = ROOT / "docs" / "hard-cases-mitsuba.jsonl"
WORKER = ROOT / "tools" / "benchmarks" / "hard_worker.py"
SECONDS = 20
"""That a case may take, of which some go into starting Mitsuba."""
SLACK = 1e-3
"""Relative difference that is not called wrong, beside that of chance."""


def readable(scene: dict[str, Any] | Scene) -> dict[str, Any] | None:
    """A case's scene as Mitsuba has it too; None for what is only clvol's.

    Mitsuba has no `emission` of media, which changes nothing at albedo 1, and no cameras in media that it is
    not told of.  Sparse grids and repaired meshes are clvol's objects.
    """
    if isinstance(scene, Scene):
        return None
    made: dict[str, Any] = {}
    eye = np.append(np.asarray(scene["sensor"]["to_world"])[:3, 3], 1.0)
    for name, node in scene.items():
        if isinstance(node, dict) and node.get("type") == "cube":
            local = np.linalg.inv(np.asarray(node["to_world"], float)) @ eye
            medium = dict(node["interior"])
            if np.abs(local[:3]).max() <= 1 + 1e-6:
                return None
            if medium.pop("emission", None) is not None and medium.get("albedo") != 1.0:
                return None
            if not isinstance(medium.get("sigma_t", {}), dict | float) or medium.get("type") == "ref":
                return None
            data = medium["sigma_t"].get("data") if isinstance(medium.get("sigma_t"), dict) else None
            if data is not None and not isinstance(data, np.ndarray):
                return None
            node = node | {"interior": medium}
        made[name] = node
    return made


def seen_by_mitsuba(python: str, case: Case) -> dict[str, Any] | None:
    """What it shows, and a word for that; None where it cannot read the case."""
    scene = readable(case.scene())
    if scene is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene"
        path.write_bytes(pickle.dumps(scene))
        command = [python, str(WORKER), str(path), str(case.spp)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return {"case": case.name, "word": f"not done in {SECONDS} s", "mean": [], "error": []}
    if done.returncode:
        click.echo(f"{case.name}: {done.stderr.strip().splitlines()[-1] if done.stderr else done.returncode}")
        return None
    answer = json.loads(done.stdout.splitlines()[-1])
    return {"case": case.name, **judged(np.array(answer["pixels"]), case), "version": answer["version"]}


def judged(pixels: np.ndarray, case: Case) -> dict[str, Any]:
    """Mean and standard error of pixels of one expectation, and whether it is that of the case."""
    mean, error = pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))
    expected = np.broadcast_to(np.atleast_1d(case.expected()), 3)
    if not np.isfinite(pixels).all():
        return {"word": f"{int((~np.isfinite(pixels)).sum())} values not finite", "mean": [], "error": []}
    off = np.maximum(np.abs(mean - expected) - SLACK * np.abs(expected), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(off > 0, off / error, 0.0)
    p = float(2 * stdtr(len(pixels) - 1, -z).min() * 3)
    missed = np.exp(-len(pixels) * case.spp * expected.max() / case.brightest)  # that no sample met it
    if not mean.any() and missed < ALPHA / 100:
        return {"word": "black", "mean": [0.0], "error": [0.0]}
    known = expected != 0
    noisy = (error[known] > NOISY * expected[known]).any() or (mean[known] == 0).any()
    word = "wrong" if p < ALPHA / 100 and not noisy else "too noisy" if noisy else "right"
    same = bool((expected == expected[0]).all())
    return {
        "word": word,
        "mean": [float(f"{v:.6g}") for v in (mean[:1] if same else mean)],
        "error": [float(f"{v:.2g}") for v in (error[:1] if same else error)],
    }


def read() -> dict[str, dict[str, Any]]:
    """What was seen so far."""
    if not FIGURES.exists():
        return {}
    lines = map(json.loads, FIGURES.read_text(encoding="utf-8").splitlines())
    return {line["case"]: line for line in lines}


def measure(python: str, cases: Sequence[Case]) -> None:
    """Of each case of which nothing has been seen."""
    found = read()
    for case in cases:
        if case.name not in found and (seen := seen_by_mitsuba(python, case)):
            with FIGURES.open("a", encoding="utf-8") as file:
                file.write(json.dumps(seen) + "\n")
            click.echo(f"{case.name}: {seen['word']}, {seen['mean']} ± {seen['error']}, {case.expected()}")
