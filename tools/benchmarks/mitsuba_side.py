"""Mitsuba 3.9 in an environment of its own, driven from here: renders on request, one at a time."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import click
import numpy as np
from folders import cached

WORKER = Path(__file__).with_name("mitsuba_worker.py")
REQUIREMENT = "mitsuba==3.9.*"


def mitsuba_python(given: str | None) -> str:
    """The Python that has Mitsuba: the one given, else that of a cached environment, made when missing."""
    if given:
        return given
    folder = cached("mitsuba-3.9")
    python, ready = folder / "bin" / "python", folder / "ready"
    if not ready.exists():
        click.echo(f"installing {REQUIREMENT} in {folder}", err=True)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", REQUIREMENT, "numpy"], check=True)
        ready.touch()
    return str(python)


class MitsubaSide:
    """A running worker with one scene loaded; a context manager."""

    def __init__(self, python: str, scene: str, defaults: dict[str, str], threads: int) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="clvol-bench-")
        self._worker = subprocess.Popen(
            [python, WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        answer = self._ask({"load": scene, "defaults": defaults, "threads": threads})
        self.version: str = answer["version"]
        self.setup_cpu: float = answer["cpu"]

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        print(json.dumps(request), file=self._worker.stdin, flush=True)
        line = self._worker.stdout.readline()
        if not line:
            raise click.ClickException("Mitsuba's worker ended; what it said stands above")
        return json.loads(line)

    def render(self, spp: int, seed: int) -> tuple[np.ndarray, float, float]:
        """Image (height, width, 3), CPU seconds, wall seconds."""
        path = Path(self._folder.name) / "image.npy"
        answer = self._ask({"spp": spp, "seed": seed, "image": str(path)})
        return np.load(path), answer["cpu"], answer["wall"]

    def __enter__(self) -> MitsubaSide:
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.stdin.close()
        self._worker.wait()
        self._worker.stdout.close()
        self._folder.cleanup()
