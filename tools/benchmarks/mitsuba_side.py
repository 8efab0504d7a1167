"""Mitsuba 3.9 in an environment of its own."""

from __future__ import annotations

import subprocess
import sys

import click
from folders import cached

from benchmarks.worker import Worker

REQUIREMENT = "mitsuba==3.9.*"
FOLDER = cached("mitsuba-3.9")


def mitsuba_python(given: str | None) -> str:
    """The Python that has Mitsuba: the one given, else that of a cached environment, made when missing."""
    if given:
        return given
    if found := cached_mitsuba():
        return found
    python = FOLDER / "bin" / "python"
    click.echo(f"installing {REQUIREMENT} in {FOLDER}", err=True)
    subprocess.run([sys.executable, "-m", "venv", FOLDER], check=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", REQUIREMENT, "numpy"], check=True)
    (FOLDER / "ready").touch()
    return str(python)


def cached_mitsuba() -> str | None:
    """The Python of the cached environment, if it has been made."""
    return str(FOLDER / "bin" / "python") if (FOLDER / "ready").exists() else None


class MitsubaSide(Worker):
    """Mitsuba with one scene loaded."""

    def __init__(self, python: str, scene: str, defaults: dict[str, str], threads: int) -> None:
        request = {"load": scene, "defaults": defaults, "threads": threads}
        super().__init__(python, "mitsuba_worker.py", request)
