"""How the benchmark prints and writes its figures."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from documents import write
from rich.console import Console
from rich.table import Table

from clvol.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterable

Figures = dict[str, Any]
Outcome = tuple[Path | None, Figures]
"""What a command returns: the file to write its figures to, and the figures."""
NO_AIM = "–"


class Unavailable(click.ClickException):
    """What a measurement compares with cannot be had on this machine: what that is, and what to do."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint

    def format_message(self) -> str:
        """Both, in one line."""
        return f"{self.message}; {self.hint}"


@dataclass(frozen=True)
class Row:
    """One line of the performance table: what was measured, how much it is, what it should be.

    met : whether it is so; True where nothing is asked.
    """

    figure: str
    measured: str
    aim: str = NO_AIM
    met: bool = True

    @property
    def verdict(self) -> str:
        """Met or missed, in a word; nothing where nothing is asked."""
        return "" if self.aim == NO_AIM else "met" if self.met else "MISSED"


def at_least(figure: str, measured: str, least: float, *values: float) -> Row:
    """A row whose values should all be so large."""
    return Row(figure, measured, f"at least {least:g}", min(values) >= least)


def at_most(figure: str, measured: str, most: float, unit: str, *values: float) -> Row:
    """A row whose values should all be so small."""
    return Row(figure, measured, f"at most {most:g}{unit}", max(values) <= most)


def show_rows(rows: list[Row]) -> None:
    """The figures beside their aims."""
    cells = [(row.figure.replace("`", ""), row.measured, row.aim, row.verdict) for row in rows]
    show("figures and aims", ["figure", "measured", "aim", ""], cells)


def judge(rows: list[Row]) -> int:
    """Print figures beside their aims, and on standard error what is missed; the exit status: 1 if any is."""
    if rows:
        show_rows(rows)
    missed = [row for row in rows if not row.met]
    for row in missed:
        click.echo(f"MISSED: {row.figure}: {row.measured}; aim: {row.aim}", err=True)
    return 1 if missed else 0


def markdown(rows: Iterable[Row]) -> list[str]:
    """The same as lines of Markdown."""
    lines = ["| figure | measured | aim |", "|---|---|---|"]
    for row in rows:
        lines.append(f"| {row.figure} | {row.measured} | {row.aim}{'' if row.met else ': **missed**'} |")
    return lines


def thread_count() -> int:
    """Threads on every side: POCL_MAX_PTHREAD_COUNT, else every core this process may use."""
    return int(os.environ.get("POCL_MAX_PTHREAD_COUNT") or len(os.sched_getaffinity(0)))


def show(title: str, columns: list[str], rows: list[tuple[str, ...]]) -> None:
    """Print a table: names to the left, numbers to the right."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else "right")
    for row in rows:
        table.add_row(*row)
    console = Console()
    console.width = max(console.width, 120)  # a pipe counts as 80 columns
    console.print(table)


def ranged(figure: dict[str, float], digits: int = 3) -> str:
    """Median (least to greatest)."""
    median, least, greatest = (f"{figure[k]:.{digits}g}" for k in ("median", "least", "greatest"))
    return f"{median} ({least} to {greatest})"


def save(json_path: Path | None, figures: Figures) -> None:
    """Write the figures, and on what they were measured, where asked to."""
    if json_path:
        machine = {"machine": platform.platform(), "cores": os.cpu_count(), "threads": thread_count()}
        versions = {"clvol": __version__, "python": platform.python_version()}
        write(json_path, json.dumps(machine | versions | figures, indent=1) + "\n")
