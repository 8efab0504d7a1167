"""Progress of a render: the record a renderer hands out, and the bar that shows it."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from typing import IO, TYPE_CHECKING, Any, NoReturn, Protocol, Self, cast

from clvol.errors import OptionError

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console
    from rich.progress import Progress as RichBar
    from rich.progress import ProgressColumn, TaskID


_READING_PACE = 20.0
"""Times what a reading of the noise took that passes before the next."""


class Seen(Protocol):
    """The picture so far, as `clvol.picture.result.Result` has it."""

    @property
    def image(self) -> np.ndarray:
        """Mean linear radiance, float32 (height, width, 3)."""

    @property
    def noise(self) -> float:
        """Mean relative standard error of the image; nan while unknown."""


class Glance:
    """The picture so far, made when it is first asked for, in the block in which a callback may ask.

    After it the film goes on, and there is no such picture any more; its noise stays known.

    Parameters
    ----------
    make : makes the picture; None while no pixel has a sample.
    callback : for whom; a bar reads the noise when it likes, for others it is known at the end of the block.
    """

    def __init__(self, make: Callable[[], Seen | None], callback: ProgressCallback) -> None:
        self._make: Callable[[], Seen | None] = cache(make)
        self._self_paced = getattr(callback, "self_paced", False)
        self._noise: float | None = None
        self._image: np.ndarray | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        if not (self._self_paced or any(exception)):
            self.noise()
        self._make = _closed

    def image(self) -> np.ndarray | None:
        """The picture's; None while there is none.  OptionError after the block, if it is asked for late."""
        if self._image is None and (seen := self._make()) is not None:
            self._image = seen.image
        return self._image

    def noise(self) -> float:
        """The picture's; nan while unknown."""
        if self._noise is None:
            seen = self._make()
            self._noise = math.nan if seen is None else seen.noise
        return self._noise


def _closed() -> NoReturn:
    raise OptionError(
        "a progress record shows its picture only while the callback runs",
        hint="take the image there, or iterate over clvol.progressive",
    )


@dataclass(frozen=True)
class Progress:
    """How far a render is, and in a callback what its picture is so far: `image` and `noise`.

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
    what : str
        What is going on; samples are those of the picture only while it is "rendering", else steps.
    glance : Glance or None
        At the picture so far.
    """

    samples_done: int
    samples_total: int | None
    seconds: float
    time_limit: float | None = None
    what: str = "rendering"
    glance: Glance | None = field(default=None, repr=False, compare=False)

    @property
    def image(self) -> np.ndarray | None:
        """Mean linear radiance of the samples done, float32 (height, width, 3); None before the first.

        It is read from the device when it is asked for, which the callback must do.
        """
        return None if self.glance is None else self.glance.image()

    @property
    def noise(self) -> float:
        """Mean relative standard error of that image (`clvol.Result.noise`); nan while unknown."""
        return math.nan if self.glance is None else self.glance.noise()

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


class Several:
    """Callbacks as one; what they read of a picture is read once."""

    def __init__(self, *callbacks: ProgressCallback) -> None:
        self.callbacks = callbacks
        self.self_paced = all(getattr(callback, "self_paced", False) for callback in callbacks)

    def __call__(self, record: Progress) -> None:
        """Hand the record on."""
        for callback in self.callbacks:
            callback(record)


class PacedNoise:
    """The noise of the picture so far, at a small share of the render's time: what a bar shows.

    It is read as long as that takes no more than a twentieth of the time; between two readings it is what the
    last one becomes by so many more samples, of independent errors.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._noise, self._samples = math.nan, 0
        self._due = -math.inf

    def of(self, record: Progress) -> float:
        """The noise at a record; read whatever it costs at the last one."""
        start = self._clock()
        if start >= self._due or record.samples_done == record.samples_total:
            self._noise, self._samples = record.noise, record.samples_done
            end = self._clock()
            self._due = end + _READING_PACE * (end - start)
        return self._noise * math.sqrt(self._samples / max(record.samples_done, 1))


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

    self_paced = True

    def __init__(self, console: Console | None = None) -> None:
        self.console = console or error_console()
        self._noise = PacedNoise()
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
        if self._bar is None or self._task is None or self._bar.disable:
            return
        self._bar.update(
            self._task,
            description=record.what,
            completed=record.fraction,
            samples=format_samples(record),
            left=format_seconds(record.seconds_left),
            noise=format_noise(self._noise.of(record)),
        )

    def __exit__(self, *_exception: object) -> None:
        if self._bar is not None:
            self._bar.stop()
        self._bar = self._task = None
