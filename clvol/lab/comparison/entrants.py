"""What takes part in a comparison: its pace, what is kept of its renders, what the progress is told."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.lab.quiet import log_filter

if TYPE_CHECKING:
    from clvol.lab.trials import Trial
    from clvol.picture.result import Result

_TRIAL_SECONDS = 0.3
_ALIKE = 1.1
"""Seconds of renders that differ by less than this factor are the same."""

Told = Callable[[float, float, str], None]
"""Receives seconds of work done, seconds expected in all (0 while unknown), and what is being done."""


class Render(NamedTuple):
    """What is kept of a Result."""

    image: np.ndarray
    seconds: float
    lookups: float
    seed: int
    spp: int

    @classmethod
    def of(cls, result: Result, spp: int) -> Render:
        """Of a render of `spp` samples a pixel."""
        seconds, lookups = result.stats["seconds"]["render"], float(result.stats["lookups"])
        return cls(result.image, seconds, lookups, result.metadata["seed"], spp)


@dataclass(eq=False)
class Entrant:
    """A trial in the rounds: what it will render, and what the progress is told."""

    label: str
    trial: Trial
    told: Callable[[str], None]
    notes: dict[str, str] = field(default_factory=dict)
    spp: int = 1
    pace: float = 0.0
    """Seconds per sample of every pixel."""
    variance: float = math.inf
    """Of one such sample, mean over the picture."""

    def render(self, seed: int, spp: int) -> Result:
        """As `Trial.render`; warnings are kept, and shown once."""
        with _noted(self.notes):
            result = self.trial.render(seed, spp)
        self.told(self.label)
        return result

    def try_out(self, seeds: Iterator[int], most: int | None) -> None:
        """Find pace and variance from renders that are not used otherwise."""
        spp = 1
        while True:
            first = self.render(next(seeds), spp)
            taken = first.stats["seconds"]["render"]
            if taken >= _TRIAL_SECONDS or (most is not None and spp >= most) or spp >= 2**20:
                break
            spp *= 2 if taken > _TRIAL_SECONDS / 4 else 4
            spp = spp if most is None else min(spp, most)
        second, third = (self.render(next(seeds), spp) for _ in range(2))
        self.pace = float(np.median([r.stats["seconds"]["render"] for r in (first, second, third)])) / spp
        difference = first.image.astype(np.float64) - second.image
        self.variance = float((difference**2).mean()) / 2 * spp

    def render_for(self, seconds: float, seeds: Iterator[int]) -> Render:
        """One render of about so many seconds, of a sample at least; a second where the first took others."""
        spp = self._affordable(seconds, self.pace)
        made = Render.of(self.render(next(seeds), spp), spp)
        again = self._affordable(seconds, made.seconds / spp)
        if max(again, spp) <= _ALIKE * min(again, spp):
            return made
        return Render.of(self.render(next(seeds), again), again)

    @staticmethod
    def _affordable(seconds: float, pace: float) -> int:
        return max(1, round(seconds / max(pace, 1e-9)))


@contextmanager
def _noted(notes: dict[str, str]) -> Iterator[None]:
    """Let each warning of clvol's log through once; collect it under its wording without numbers."""

    def first_time(record: logging.LogRecord) -> bool:
        if record.levelno < logging.WARNING:
            return False
        wording = str(record.msg) + str([a for a in record.args or () if isinstance(a, str)])
        known = wording in notes
        notes.setdefault(wording, record.getMessage())
        return not known

    with log_filter(first_time):
        yield


class Clock:
    """Counts expected seconds of work, render by render."""

    def __init__(self, told: Told) -> None:
        self.told = told
        self.expected: dict[str, float] = {}
        self.total = self.done = 0.0

    def expect(self, seconds: dict[str, float], turns: int, once: float) -> None:
        """From now on, so many seconds for each render of a label; `once` are those before the turns."""
        self.expected, self.total = seconds, turns * sum(seconds.values()) + once
        self.told(0.0, self.total, "rendering by turns")

    def tick(self, label: str) -> None:
        """A render is done."""
        self.done = min(self.done + self.expected.get(label, 0.0), self.total)
        self.told(
            self.done, self.total, "rendering by turns" if self.total else f"finding the pace of {label}"
        )
