"""Rendering by turns: rounds of every combination and of the reference.

A short trial sets the samples of a round; each render has a seed of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clvol.base.interrupts import interruptible
from clvol.lab.comparison.entrants import Clock, Entrant, Render, Told
from clvol.lab.comparison.reference import Reference
from clvol.lab.comparison.shorter import shorter_spp
from clvol.lab.efficiency import LEAST_ROUNDS
from clvol.lab.seeds import seeds_from
from clvol.lab.trials import Trial, rounds
from clvol.planning.registry import SAMPLERS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from clvol.lab.comparison.combine import Lineup

REFERENCE_SAMPLES = 10
"""The reference has about so many times the samples that its combination has in all rounds together."""


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


class Rounds(NamedTuple):
    """Independent renders of equal length.

    images : float32 (rounds, height, width, 3).
    seconds, lookups : float64 (rounds,): of each render.
    """

    images: np.ndarray
    seconds: np.ndarray
    lookups: np.ndarray

    @classmethod
    def of(cls, renders: Sequence[Render]) -> Rounds:
        """What was kept of each, in arrays."""
        numbers = np.array([(r.seconds, r.lookups) for r in renders])
        return cls(np.stack([r.image for r in renders]), *numbers.T)


@dataclass(frozen=True, eq=False)
class Measured:
    """One combination's rounds.

    Parameters
    ----------
    spp, images, seconds, lookups : samples per pixel of each render, and `Rounds` of them.
    seeds : of each render.
    picture : one render that took about the same seconds as those of the other combinations.
    notes : warnings it gave, each once.
    shorter : as many renders with fewer samples, by samples of a render.
    """

    label: str
    trial: Trial
    spp: int
    images: np.ndarray
    seconds: np.ndarray
    lookups: np.ndarray
    seeds: tuple[int, ...]
    picture: Render
    notes: tuple[str, ...] = ()
    shorter: dict[int, Rounds] = field(default_factory=dict)


def measure(
    lineup: Lineup, effort: Effort, given: Reference | None, spare: Callable[[], Trial], told: Told
) -> tuple[list[Measured], Reference, bool]:
    """Render all rounds: the combinations, the reference, and whether Ctrl-C ended them early.

    `spare` opens an unbiased trial, for the case that none of the line-up's is.  Ctrl-C keeps the rounds that
    are complete; KeyboardInterrupt where they are fewer than `efficiency.LEAST_ROUNDS`.
    """
    clock = Clock(told)
    taken = given.seeds if given else None
    # How many trials there are depends on the machine's pace; the rounds' seeds do not.
    seeds, trial_seeds = seeds_from(effort.seed, taken), seeds_from((effort.seed + 2**63) % 2**64, taken)
    entrants = [Entrant(label, trial, clock.tick) for label, trial in lineup.trials.items()]
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
    pictured = equal_seconds(entrants)
    clock.expect({e.label: e.pace * e.spp for e in running}, effort.rounds, pictured * len(entrants))
    pictures = [entrant.render_for(pictured, trial_seeds) for entrant in entrants]
    done, interrupted = _rounds(running, effort.rounds, seeds)
    columns = list(zip(*done, strict=True))
    measured = [_measured(*parts) for parts in zip(entrants, pictures, columns, strict=False)]
    for (entrant, spp, _), column in zip(shorter, columns[len(entrants) :], strict=False):
        measured[entrants.index(entrant)].shorter[spp] = Rounds.of(column)
    if given is None:
        made = running[-1]
        images = np.stack([r.image for r in columns[-1]])
        seen = f"{made.trial.options or 'closed forms'}; {len(done)} rounds of {made.spp} spp"
        seeds_used = [r.seed for r in columns[-1]]
        source = f"made with {seen}, seeds of its own"
        given = Reference.of_rounds(images, made.spp, source, (min(seeds_used), max(seeds_used)))
    return measured, given, interrupted


def equal_seconds(entrants: Sequence[Entrant]) -> float:
    """Seconds for a picture of each: as many as a round's in the middle, and a sample of the slowest's."""
    return max(float(np.median([e.pace * e.spp for e in entrants])), max(e.pace for e in entrants))


def _rounds(running: list[Entrant], count: int, seeds: Iterator[int]) -> tuple[list[list[Render]], bool]:
    """`count` rounds, or those that were complete at a Ctrl-C, and whether there was one."""
    done: list[list[Render]] = []
    with interruptible() as interrupt:
        try:
            interrupt.heed(patience=0)
            for results in rounds(running, [e.spp for e in running], seeds):
                done.append([Render.of(r, e.spp) for r, e in zip(results, running, strict=True)])
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
    entrants: list[Entrant],
    lineup: Lineup,
    effort: Effort,
    spare: Callable[[], Trial],
    trial_seeds: Iterator[int],
    clock: Clock,
) -> Entrant:
    """The most efficient unbiased combination of the trial, again, with many more samples."""
    unbiased = [e for e in entrants if not e.trial.biased]
    if not unbiased:
        unbiased = [Entrant("auto", spare(), clock.tick)]
        unbiased[0].try_out(trial_seeds, effort.spp)
        unbiased[0].spp = effort.spp or _samples(effort.seconds / effort.rounds / unbiased[0].pace, lineup)
    best = min(unbiased, key=lambda e: e.variance * e.pace)
    spp = _samples(REFERENCE_SAMPLES * best.spp, lineup)
    if effort.reference_spp is not None:
        spp = math.ceil(effort.reference_spp / effort.rounds)
    return Entrant("reference", best.trial, clock.tick, best.notes, spp, best.pace, best.variance)


def _measured(entrant: Entrant, picture: Render, results: tuple[Render, ...]) -> Measured:
    return Measured(
        *(entrant.label, entrant.trial, entrant.spp),
        *Rounds.of(results),
        tuple(r.seed for r in results),
        picture,
        tuple(entrant.notes.values()),
    )
