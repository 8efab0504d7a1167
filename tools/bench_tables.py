"""How the benchmark prints and writes its figures."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from clvol.version import __version__

Figures = dict[str, Any]


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


def against(value: float, target: float, at_least: bool = False) -> str:
    """The target, and whether it is met."""
    met = value >= target if at_least else value <= target
    return f"{'at least' if at_least else 'at most'} {target:g}: {'met' if met else 'MISSED'}"


def save(json_path: str | None, figures: Figures) -> None:
    """Write the figures, and on what they were measured, where asked to."""
    if json_path:
        machine = {"machine": platform.platform(), "cores": os.cpu_count(), "threads": thread_count()}
        versions = {"clvol": __version__, "python": platform.python_version()}
        Path(json_path).write_text(json.dumps(machine | versions | figures, indent=1) + "\n")
