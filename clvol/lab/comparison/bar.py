"""The progress bar of a comparison."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from clvol.base.progress import bar_of, error_console, format_seconds

if TYPE_CHECKING:
    from rich.console import Console


class Bar:
    """Progress on standard error, time left included; silent where that is no terminal.

    A context manager that is called with seconds done, seconds expected and what is being done.
    """

    def __init__(self, console: Console | None = None) -> None:
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

        self._bar = bar_of(
            console or error_console(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
        )
        self._task = self._bar.add_task("opening the scene", total=None, left="")
        self._began: float | None = None

    def __enter__(self) -> Bar:
        self._bar.start()
        return self

    def __call__(self, done: float, expected: float, text: str) -> None:
        """Show how far it is; seconds expected are 0 while nobody knows."""
        left = ""
        if expected:
            if self._began is None:  # the pace of opening says nothing about that of rendering
                self._began = time.monotonic()
                self._bar.reset(self._task)
            left = progress_words(done, expected, time.monotonic() - self._began)
        self._bar.update(self._task, description=text, completed=done, total=expected or None, left=left)

    def __exit__(self, *_exception: object) -> None:
        self._bar.stop()


def progress_words(done: float, expected: float, passed: float) -> str:
    """Share done and time left, at the pace so far; at the expected one while nothing is done."""
    left = passed * (expected - done) / done if done > 0 else expected
    return f"passed, {100 * done / expected:.0f} % done, {format_seconds(max(left, 0.0))} left"
