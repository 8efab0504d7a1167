"""The progress bar of a comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


class Bar:
    """Progress on standard error, time left included; silent where that is no terminal.  A context manager
    that is called with seconds done, seconds expected and what is being done."""

    def __init__(self, console: Console | None = None) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        console = console or Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("passed,"),
            TimeRemainingColumn(),
            TextColumn("left"),
            console=console,
            disable=not console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("opening the scene", total=None)
        self._measuring = False

    def __enter__(self) -> Bar:
        self._bar.start()
        return self

    def __call__(self, done: float, expected: float, text: str) -> None:
        if expected and not self._measuring:  # the pace of opening says nothing about that of rendering
            self._measuring = True
            self._bar.reset(self._task)
        self._bar.update(self._task, description=text, completed=done, total=expected or None)

    def __exit__(self, *_exception: object) -> None:
        self._bar.stop()
