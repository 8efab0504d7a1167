"""A program in an environment of its own that renders one scene on request, picture by picture.

Requests and answers are JSON objects, one a line: what to load, then samples, seed and where to leave the
picture.  clvol_worker.py, mitsuba_worker.py and cycles_worker.py answer them.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping


class Rendered(NamedTuple):
    """A picture (height, width, 3), what it took, and what the program counted."""

    image: np.ndarray
    cpu: float
    wall: float
    stats: dict[str, Any]


class Worker:
    """A running program with one scene loaded; a context manager.

    Parameters
    ----------
    python, script : what runs.  script : a file beside this one.
    load : the first request.
    environment : variables that are changed for it.

    Attributes
    ----------
    version, load_cpu, load_wall : of the program, and what loading took.
    """

    def __init__(
        self, python: str, script: str, load: dict[str, Any], environment: Mapping[str, str] | None = None
    ) -> None:
        self._name = f"{script} in {python}"
        self._folder = tempfile.TemporaryDirectory(prefix="clvol-bench-")
        self._process = subprocess.Popen(
            [python, Path(__file__).with_name(script)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | dict(environment or {}),
        )
        try:
            answer = self._ask(load)
        except BaseException:
            self.close()
            raise
        self.version: str = answer["version"]
        self.load_cpu: float = answer["cpu"]
        self.load_wall: float = answer["wall"]

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        line = ""
        try:
            print(json.dumps(request), file=self._process.stdin, flush=True)
            line = self._process.stdout.readline()
        except BrokenPipeError:
            pass
        if not line:
            raise click.ClickException(f"{self._name} ended; what it said stands above")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def render(self, spp: int, seed: int) -> Rendered:
        """A picture of the scene."""
        path = Path(self._folder.name) / "image.npy"
        answer = self._ask({"spp": spp, "seed": seed, "image": str(path)})
        return Rendered(np.load(path)[..., :3], answer["cpu"], answer["wall"], answer.get("stats", {}))

    def close(self) -> None:
        """End the program."""
        with contextlib.suppress(BrokenPipeError):  # what a program that has ended did not take
            self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()
        self._folder.cleanup()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
