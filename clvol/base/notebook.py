"""Progress in a notebook: one line that is written anew, and stays with what came of the work.

A notebook's output is no terminal, and what is shown with a display of IPython reaches those that look at it
live as well as those that run it unattended (nbconvert, papermill), who keep the last line.
"""

from __future__ import annotations

import html
import sys
import time
from typing import TYPE_CHECKING, Any, Self

from clvol.base.progress import (
    PacedNoise,
    RichProgress,
    format_noise,
    format_samples,
    format_seconds,
)

if TYPE_CHECKING:
    from clvol.base.progress import Progress

_PACE_SECONDS = 0.2
"""Lines are written at most this often: each is a message to the notebook."""


def in_notebook() -> bool:
    """Whether this process is a notebook's kernel, rather than a program or IPython in a terminal."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return getattr(shell, "kernel", None) is not None


def progress_bar() -> RichProgress | NotebookProgress:
    """The bar for where this process shows things: a notebook, or a terminal."""
    return NotebookProgress() if in_notebook() else RichProgress()


class NotebookProgress:
    """Progress in a notebook's output: samples done, time left and noise.

    Use it as a context manager and call it with each `Progress` record.
    """

    self_paced = True

    def __init__(self) -> None:
        self._noise = PacedNoise()
        self._handle: Any = None
        self._due = 0.0

    def __enter__(self) -> Self:
        self._show(_Line("rendering", 0.0))
        return self

    def __call__(self, record: Progress) -> None:
        """Show where the render is, unless it was shown just before."""
        last = record.samples_done == record.samples_total
        if not last and time.perf_counter() < self._due:
            return
        left = "" if last else f"{format_seconds(record.seconds_left)} left"
        noise = f"noise {format_noise(self._noise.of(record))}"
        parts = (record.what, format_samples(record), f"{record.seconds:.1f} s", left, noise)
        self._show(_Line(", ".join(filter(None, parts)), record.fraction))
        self._due = time.perf_counter() + _PACE_SECONDS

    def __exit__(self, *_exception: object) -> None:
        self._handle = None

    def _show(self, line: _Line) -> None:
        from IPython.display import display

        if self._handle is None:
            self._handle = display(line, display_id=True)
        else:
            self._handle.update(line)


class _Line:
    """A text with a bar, as a notebook asks for it; terminals and files get the text."""

    def __init__(self, text: str, share: float) -> None:
        self.text, self.share = text, share

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f'<progress value="{self.share:.4f}" max="1"></progress> {html.escape(self.text)}'
