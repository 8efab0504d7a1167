"""Progress of a render: the record a renderer hands out, and the bar that shows it."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as RichBar
    from rich.progress import ProgressColumn, TaskID


_READING_PACE = 20.0
"""Times what a reading of the noise took that passes before the next."""


@dataclass(frozen=True)
class Progress:
    """How far a render is.

    Parameters
    ----------
    samples_done : int
        Samples per pixel finished so far.
    samples_total : int or None
        Samples per pixel asked for; None where only the time limit ends the render.
    seconds : float
        Time since the first launch.
    time_limit : float or None
        Seconds after which no new sample is begun.
    noise : float
        Mean relative standard error of the image so far (`clvol.picture.result.relative_noise`); nan while
        unknown.  Where reading it for each record would cost much, foreseen from the last one read.
    what : str
        What is going on; samples are those of the picture only while it is "rendering", else steps.
    """

    samples_done: int
    samples_total: int | None
    seconds: float
    time_limit: float | None = None
    noise: float = math.nan
    what: str = "rendering"

    @property
    def fraction(self) -> float:
        """Share of the work that is done, 0..1, by samples or by time, whichever ends the render first."""
        shares = [0.0]
        if self.samples_total:
            shares.append(self.samples_done / self.samples_total)
        if self.time_limit:
            shares.append(self.seconds / self.time_limit)
        return min(max(shares), 1.0)

    @property
    def seconds_left(self) -> float:
        """Estimated seconds to the end, at the pace so far; nan while nothing is known."""
        estimates = []
        if self.samples_total is not None and self.samples_done > 0:
            pace = self.seconds / self.samples_done
            estimates.append(pace * (self.samples_total - self.samples_done))
        if self.time_limit is not None:
            estimates.append(self.time_limit - self.seconds)
        return max(min(estimates), 0.0) if estimates else math.nan


ProgressCallback = Callable[[Progress], None]
"""What ``clvol.render(progress=...)`` accepts besides True and False."""


class FilmNoise:
    """The noise of the picture so far, at a small share of the render's time.

    It is read from the film as long as that takes no more than a twentieth of the time; passes between two
    readings are told what the last one becomes by so many more samples, of independent errors.

    read : noise of the film, given the samples per pixel that it has.
    """

    def __init__(self, read: Callable[[int], float], clock: Callable[[], float] = time.perf_counter) -> None:
        self._read, self._clock = read, clock
        self._noise, self._samples = math.nan, 0
        self._due = -math.inf

    def after(self, samples: int, exact: bool = False) -> float:
        """The noise after so many samples per pixel; read whatever it costs where it has to be exact."""
        start = self._clock()
        if exact or start >= self._due:
            self._noise, self._samples = self._read(samples), samples
            end = self._clock()
            self._due = end + _READING_PACE * (end - start)
        return self._noise * math.sqrt(self._samples / samples)


def format_samples(record: Progress) -> str:
    """Samples done, as "12/64 spp", or "12 spp" where only time ends the render."""
    total = "" if record.samples_total is None else f"/{record.samples_total}"
    unit = " spp" if record.what == "rendering" else ""
    return f"{record.samples_done}{total}{unit}"


def format_noise(noise: float) -> str:
    """Relative noise as a percentage, of two significant digits below 10 %; "unknown" for nan."""
    if not math.isfinite(noise):
        return "unknown"
    percent = 100 * noise
    return f"{percent:.2g} %" if percent < 10 else f"{percent:.0f} %"


def format_seconds(seconds: float) -> str:
    """Duration as "8 s", "2:05" or "1:02:05"; "-" for nan."""
    if not math.isfinite(seconds):
        return "-"
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours}:{minutes:02}:{rest:02}"
    return f"{minutes}:{rest:02}" if minutes else f"{rest} s"


class _Lasting:
    """Standard error without its failures: a terminal that is gone, or a full disk, is no end of a render."""

    def __init__(self) -> None:
        self._stream = sys.stderr

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """As of any stream, but silent where that fails."""
        with suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """As of any stream, but silent where that fails."""
        with suppress(OSError):
            self._stream.flush()


def error_console() -> Console:
    """Standard error, for bars and messages of long work, which does not end with it."""
    from rich.console import Console

    return Console(file=cast("IO[str]", _Lasting()))


def bar_of(console: Console, *columns: ProgressColumn) -> RichBar:
    """A bar of such columns, which leaves no trace when it is done; silent where `console` is no terminal."""
    from rich.progress import Progress as RichBar

    return RichBar(*columns, console=console, disable=not console.is_terminal, transient=True)


class RichProgress:
    """Progress bar on standard error: samples done, time left and noise; silent where that is no terminal.

    Use it as a context manager and call it with each `Progress` record.
    """

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or error_console()
        self._bar: RichBar | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> RichProgress:
        from rich.progress import BarColumn, TextColumn

        self._bar = bar_of(
            self.console,
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[samples]}  {task.fields[left]} left  noise {task.fields[noise]}"),
        )
        self._task = self._bar.add_task("rendering", total=1.0, samples="0 spp", left="-", noise="unknown")
        self._bar.start()
        return self

    def __call__(self, record: Progress) -> None:
        """Show where the render is."""
        if self._bar is None or self._task is None:
            return
        self._bar.update(
            self._task,
            description=record.what,
            completed=record.fraction,
            samples=format_samples(record),
            left=format_seconds(record.seconds_left),
            noise=format_noise(record.noise),
        )

    def __exit__(self, *_exception: object) -> None:
        if self._bar is not None:
            self._bar.stop()
        self._bar = self._task = None
