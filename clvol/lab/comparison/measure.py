"""Rendering by turns: rounds of every combination and of the reference.

A short trial sets the samples of a round; each render has a seed of its own.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.base.interrupts import interruptible
from clvol.lab.comparison.reference import Reference
from clvol.lab.comparison.shorter import shorter_spp
from clvol.lab.efficiency import LEAST_ROUNDS
from clvol.lab.quiet import log_filter
from clvol.lab.seeds import seeds_from
from clvol.lab.trials import Trial, rounds
from clvol.planning.registry import SAMPLERS

if TYPE_CHECKING:
    from clvol.lab.comparison.combine import Lineup
    from clvol.picture.result import Result

REFERENCE_SAMPLES = 10
"""The reference has about so many times the samples that its combination has in all rounds together."""
_TRIAL_SECONDS = 0.3

Told = Callable[[float, float, str], None]
"""Receives seconds of work done, seconds expected in all (0 while unknown), and what is being done."""


@dataclass(frozen=True)
class Effort:
    """How much to render.

    Parameters
    ----------
    rounds : of every combination.
    seconds : that each combination renders for, over all its rounds; the reference and shorter renders apart.
        With samplers sobol and joint it is what comes nearest with a power of two of samples.
    spp : samples per pixel of one round instead, for all alike.
    reference_spp : samples per pixel of the reference; None takes `REFERENCE_SAMPLES` times those of all
        rounds of the combination that it is made with.
    seed : of the first render; all others count up from it.
    """

    rounds: int = 10
    seconds: float = 10.0
    spp: int | None = None
    reference_spp: int | None = None
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Measured:
    """One combination's rounds.

    Parameters
    ----------
    images : float32 (rounds, height, width, 3)
    seconds, lookups : float64 (rounds,): of each render.
    seeds : of each render.
    notes : warnings it gave, each once.
    shorter : images of as many renders with fewer samples, by samples of a render.
    """

    label: str
    trial: Trial
    spp: int
    images: np.ndarray
    seconds: np.ndarray
    lookups: np.ndarray
    seeds: tuple[int, ...]
    notes: tuple[str, ...] = ()
    shorter: dict[int, np.ndarray] = field(default_factory=dict)


class _Render(NamedTuple):
    """What is kept of a Result."""

    image: np.ndarray
    seconds: float
    lookups: float
    seed: int

    @classmethod
    def of(cls, result: Result) -> _Render:
        stats = result.stats
        return cls(result.image, stats["seconds"]["render"], float(stats["lookups"]), result.metadata["seed"])


@dataclass(eq=False)
class _Entrant:
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


def measure(
    lineup: Lineup, effort: Effort, given: Reference | None, spare: Callable[[], Trial], told: Told
) -> tuple[list[Measured], Reference, bool]:
    """Render all rounds: the combinations, the reference, and whether Ctrl-C ended them early.

    `spare` opens an unbiased trial, for the case that none of the line-up's is.  Ctrl-C keeps the rounds that
    are complete; KeyboardInterrupt where they are fewer than `efficiency.LEAST_ROUNDS`.
    """
    clock = _Clock(told)
    taken = given.seeds if given else None
    # How many trials there are depends on the machine's pace; the rounds' seeds do not.
    seeds, trial_seeds = seeds_from(effort.seed, taken), seeds_from((effort.seed + 2**63) % 2**64, taken)
    entrants = [_Entrant(label, trial, clock.tick) for label, trial in lineup.trials.items()]
    for entrant in entrants:
        entrant.try_out(trial_seeds, effort.spp)
        entrant.spp = effort.spp or _samples(effort.seconds / effort.rounds / max(entrant.pace, 1e-9), lineup)
    shorter = [
        (e, spp, replace(e, spp=spp, label=f"{e.label}, {spp} spp"))
        for e in entrants
        for spp in shorter_spp(e.spp)
    ]
    running = [*entrants, *(short for *_, short in shorter)]
    if given is None:
        running.append(_reference_entrant(entrants, lineup, effort, spare, trial_seeds, clock))
    clock.expect({e.label: e.pace * e.spp for e in running}, effort.rounds)
    done, interrupted = _rounds(running, effort.rounds, seeds)
    columns = list(zip(*done, strict=True))
    measured = [_measured(e, column) for e, column in zip(entrants, columns, strict=False)]
    for (entrant, spp, _), column in zip(shorter, columns[len(entrants) :], strict=False):
        measured[entrants.index(entrant)].shorter[spp] = np.stack([r.image for r in column])
    if given is None:
        made = running[-1]
        images = np.stack([r.image for r in columns[-1]])
        seen = f"{made.trial.options or 'closed forms'}; {len(done)} rounds of {made.spp} spp"
        seeds_used = [r.seed for r in columns[-1]]
        source = f"made with {seen}, seeds of its own"
        given = Reference.of_rounds(images, made.spp, source, (min(seeds_used), max(seeds_used)))
    return measured, given, interrupted


def _rounds(running: list[_Entrant], count: int, seeds: Iterator[int]) -> tuple[list[list[_Render]], bool]:
    """`count` rounds, or those that were complete at a Ctrl-C, and whether there was one."""
    done: list[list[_Render]] = []
    with interruptible() as interrupt:
        try:
            interrupt.heed(patience=0)
            for results in rounds(running, [e.spp for e in running], seeds):
                done.append([_Render.of(result) for result in results])
                if len(done) == count:
                    interrupt.keep()
                    break
        except KeyboardInterrupt:
            if len(done) < LEAST_ROUNDS:
                raise
            interrupt.keep()
            return done, True
    return done, False


def _samples(wanted: float, lineup: Lineup) -> int:
    """Samples of a render, at least 1.

    Where sampler sobol or joint takes part, a power of two from 4 on for all: others cost some of the gain.
    """
    if any(is_low_discrepancy(trial) for trial in lineup.trials.values()):
        below = 1 << max(2, math.floor(math.log2(max(wanted, 1.0))))
        return below if wanted < 1.5 * below else 2 * below
    return max(1, round(wanted))


def is_low_discrepancy(trial: Trial) -> bool:
    """Whether the number of samples matters to its efficiency."""
    sampler = SAMPLERS.get(trial.names.get("sampler", ""))
    return sampler is not None and sampler.low_discrepancy


def _reference_entrant(
    entrants: list[_Entrant],
    lineup: Lineup,
    effort: Effort,
    spare: Callable[[], Trial],
    trial_seeds: Iterator[int],
    clock: _Clock,
) -> _Entrant:
    """The most efficient unbiased combination of the trial, again, with many more samples."""
    unbiased = [e for e in entrants if not e.trial.biased]
    if not unbiased:
        unbiased = [_Entrant("auto", spare(), clock.tick)]
        unbiased[0].try_out(trial_seeds, effort.spp)
        unbiased[0].spp = effort.spp or _samples(effort.seconds / effort.rounds / unbiased[0].pace, lineup)
    best = min(unbiased, key=lambda e: e.variance * e.pace)
    spp = _samples(REFERENCE_SAMPLES * best.spp, lineup)
    if effort.reference_spp is not None:
        spp = math.ceil(effort.reference_spp / effort.rounds)
    return _Entrant("reference", best.trial, clock.tick, best.notes, spp, best.pace, best.variance)


def _measured(entrant: _Entrant, results: tuple[_Render, ...]) -> Measured:
    return Measured(
        entrant.label,
        entrant.trial,
        entrant.spp,
        np.stack([r.image for r in results]),
        np.array([r.seconds for r in results]),
        np.array([r.lookups for r in results]),
        tuple(r.seed for r in results),
        tuple(entrant.notes.values()),
    )


class _Clock:
    """Counts expected seconds of work, render by render."""

    def __init__(self, told: Told) -> None:
        self.told = told
        self.expected: dict[str, float] = {}
        self.total = self.done = 0.0

    def expect(self, seconds: dict[str, float], turns: int) -> None:
        """From now on, so many seconds for each render of a label."""
        self.expected, self.total = seconds, turns * sum(seconds.values())
        self.told(0.0, self.total, "rendering by turns")

    def tick(self, label: str) -> None:
        """A render is done."""
        self.done += self.expected.get(label, 0.0)
        self.told(
            self.done, self.total, "rendering by turns" if self.total else f"finding the pace of {label}"
        )
