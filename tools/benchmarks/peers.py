"""Who takes part in a comparison: clvol, clvol as it was at another commit, Mitsuba and Cycles."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tarfile
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click
from folders import ROOT

from benchmarks.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from benchmarks.scenes import BenchScene

CLVOL, MITSUBA, CYCLES, AGAINST = "clvol", "mitsuba", "cycles", "against"
SCRIPTS = {CLVOL: "clvol_worker.py", AGAINST: "clvol_worker.py", MITSUBA: "mitsuba_worker.py"}
MODULES = {MITSUBA: "mitsuba", CYCLES: "bpy"}
"""What a peer's Python must be able to import, beside numpy."""


@dataclass(frozen=True)
class Peer:
    """A program that renders the benchmark's scenes.

    Parameters
    ----------
    kind : CLVOL, AGAINST, MITSUBA or CYCLES.
    python : its interpreter.
    label : what tables call it, before its version.
    options : of `clvol.render`.
    environment : variables that are changed for it.
    """

    kind: str
    python: str
    label: str
    options: Mapping[str, str] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)

    def renders(self, scene: BenchScene) -> bool:
        """Whether it has all that the scene needs: in Mitsuba no medium of a grid emits."""
        return self.kind != MITSUBA or scene.emission is None

    def open(self, path: Path, res: int, threads: int) -> Worker:
        """Start it with the scene that `write_scene` wrote."""
        if self.kind == CYCLES:
            load = {"load": str(path.with_suffix(".json")), "res": res, "threads": threads}
            return Worker(self.python, "cycles_worker.py", load, self.environment)
        load = {"load": str(path), "defaults": {"res": str(res)}, "threads": threads}
        if self.kind != MITSUBA:
            load["options"] = dict(self.options)
        return Worker(self.python, SCRIPTS[self.kind], load, self.environment)


def clvol_of(folder: Path, kind: str, label: str, options: Mapping[str, str]) -> Peer:
    """The clvol whose sources are in a folder, run by this Python."""
    path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    return Peer(kind, sys.executable, label, options, {"PYTHONPATH": path})


def other_program(kind: str, python: str) -> Peer:
    """Mitsuba or Cycles in an environment of its own; click.UsageError where it is not there."""
    module = MODULES[kind]
    try:
        missing = subprocess.run([python, "-c", f"import numpy, {module}"], capture_output=True).returncode
    except OSError:
        missing = 1
    if missing:
        raise click.UsageError(f"{python} is no Python that can import {module} and numpy")
    return Peer(kind, python, kind.capitalize())


@contextmanager
def sources_of(revision: str) -> Iterator[Path]:
    """A temporary folder with clvol's sources as they were at a commit."""
    command = ["git", "archive", "--format=tar", revision, "clvol", "cl"]
    packed = subprocess.run(command, cwd=ROOT, capture_output=True)
    if packed.returncode:
        said = packed.stderr.decode(errors="replace").strip().splitlines()
        raise click.UsageError(
            f"git has no sources of '{revision}': {said[0] if said else 'no reason given'}"
        )
    with tempfile.TemporaryDirectory(prefix="clvol-bench-") as folder:
        with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as sources:
            sources.extractall(folder, filter="data")
        yield Path(folder)
