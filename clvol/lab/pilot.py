"""A short measured pilot that picks technique, transmittance and majorant by 1 / (variance · seconds).

One family after the other, what was best so far with each of the family's choices in turn: rounds by turns on
a small film, after which the worse half is dropped (successive halving), until one is left.  Further rounds
say whether it is better than auto's rules: those that chose it among many flatter it.  Seeds are others than
the picture's, so that its samples owe nothing to the choice.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.device.driver import driver_errors
from clvol.device.programs import stage_source
from clvol.errors import OptionError
from clvol.lab.candidates import (
    Candidate,
    Relative,
    clock,
    doubtful,
    halve,
    precomputation,
    relative_efficiency,
)
from clvol.lab.combinations import unbiased
from clvol.lab.quiet import quiet_renders
from clvol.lab.reduced import reduced
from clvol.lab.seeds import independent_seeds
from clvol.lab.trials import Trial
from clvol.planning.plan import Plan
from clvol.planning.registry import FAMILIES, option
from clvol.rendering.session import MAX_SAMPLES, Session
from clvol.tables.prepare import PreparedScene, prepare

if TYPE_CHECKING:
    from clvol.device.device import Device
    from clvol.planning.choices import Choices
    from clvol.planning.needs import MajorantNeeds
    from clvol.scene.records import Scene

log = logging.getLogger("clvol.pilot")
CHOSEN = ("technique", "transmittance", "majorant")
"""What a pilot chooses, in this order.

Every choice of another family costs a set of kernels, as long to build as a short pilot may render, and the
rules of auto for those were measured."""
SHARE, LEAST_SECONDS, MOST_SECONDS = 0.1, 5.0, 120.0
"""Of the expected render, and the bounds of what a pilot may take; kernel builds come on top."""
ROUNDS = 2
"""Of every candidate between two halvings."""
FINAL_ROUNDS = 4
"""Of the choice and of auto's, by turns, which say what it is worth."""
SPENT = {"technique": 0.4, "transmittance": 0.8, "majorant": 1.0}
"""Share of its time that a pilot may have used after a family; it stops halving there."""
WORTH = 1.05
"""How much more efficient than auto's rules a choice must be found for it to be taken instead; the whole
interval must be above 1 besides."""
HOPELESS = 8.0
"""A candidate whose round takes so many times as long as auto's is dropped at once."""
_LEAST_PATHS, _MOST_PIXELS, _SPP = 1 << 15, 2048, 8
_TYPICAL = 2.0  # seconds of a candidate's round over auto's, a guess to plan with
Step = Callable[[int, int], None]
"""Told how many renders of the pilot are done, of how many."""


@dataclass(frozen=True)
class Found:
    """What a pilot chose.

    Parameters
    ----------
    names : names of `CHOSEN`, by family: for `Choices`.
    options : of `clvol render`, that repeat it.  reason : one sentence.
    relative : efficiency over that of auto's rules.  seconds : of measuring; kernel_seconds : of building.
    """

    names: dict[str, str]
    options: str
    reason: str
    relative: Relative
    seconds: float
    kernel_seconds: float


def pilot(
    device: Device,
    scene: Scene,
    choices: Choices,
    *,
    seed: int,
    spp: int,
    time_limit: float | None = None,
    tell: Step | None = None,
) -> Found:
    """Choose the `CHOSEN` families that `choices` leave at auto.

    Parameters
    ----------
    seed : of the picture; the pilot's are others.
    spp, time_limit : of the picture, which decide what precomputation is worth and how long the pilot may be.
    tell : called with the renders done, and how many there will be about.
    """
    run = Pilot(device, scene, choices, independent_seeds(seed, "pilot"), spp, time_limit, tell)
    with quiet_renders():
        return run.found()


class Pilot:
    """One pilot: what its stages share.  candidates : all that were measured."""

    def __init__(
        self,
        device: Device,
        scene: Scene,
        choices: Choices,
        seeds: Iterator[int],
        spp: int,
        time_limit: float | None,
        tell: Step | None,
        keep: bool = False,
    ) -> None:
        self.keep = keep  # candidates that are out stay open, to be measured again
        self.device, self.scene, self.seeds = device, scene, seeds
        self.choices = choices.but(target_error=None)  # rounds have as many samples in every pixel
        self.small = reduced(scene, _MOST_PIXELS)
        self.plan = Plan.of(self.small, self.choices)
        self.time_limit = time_limit
        self.samples = None if spp >= MAX_SAMPLES else spp
        self.tell = tell or (lambda done, total: None)
        self.prepared: dict[MajorantNeeds, tuple[PreparedScene, float]] = {}
        self.kernel_seconds = self.seconds = 0.0
        self.whole: float | None = None  # rounds of the pilot that the picture is worth
        self.candidates: list[Candidate] = []
        self.open = [f for f in CHOSEN if choices[f] == "auto"]
        self.done = 0
        self.planned = sum(ROUNDS * 2 * len(unbiased(family)) for family in self.open) + 2 * FINAL_ROUNDS
        self.considered = {f: 0 for f in self.open}

    def found(self) -> Found:
        """Run the stages."""
        self.tell(0, self.planned)
        film = self.scene.film.window
        self.spp = _SPP
        auto = best = self._open(self.choices)
        self._plan(auto, film[2] * film[3])
        for family in self.open:
            best = self._stage(family, best, auto)
        relative = self._confirmed(best, auto)
        return self._report(best, auto, relative)

    def _confirmed(self, best: Candidate, auto: Candidate) -> Relative:
        """Efficiency of the choice over auto's, by rounds that did not choose it."""
        if best is auto:
            return Relative(1.0, 1.0, 1.0)
        both, first = (best, auto), (len(best.images), len(auto.images))
        for turn in range(FINAL_ROUNDS):
            for candidate in both if turn % 2 else both[::-1]:
                self.render(candidate)
        fresh = [candidate.since(n) for candidate, n in zip(both, first, strict=True)]
        choice, rules = fresh
        return (
            Relative(0.0, 0.0, 0.0) if doubtful(choice, rules, fresh) else relative_efficiency(choice, rules)
        )

    def _open(self, choices: Choices) -> Candidate:
        """A candidate; scenes prepared for the same needs are prepared once."""
        plan = self.plan.having(choices)
        if plan.needs not in self.prepared:
            started = clock(self.device)
            self.prepared[plan.needs] = prepare(self.small, plan), clock(self.device) - started
        prepared, seconds = self.prepared[plan.needs]
        started = clock(self.device)
        with driver_errors(self.device.description):
            session = Session.open(self.device, prepared.under(plan), 0)
        spent = clock(self.device) - started
        self.kernel_seconds += session.kernel_seconds
        seconds += spent * (1 - session.kernel_seconds / session.setup_seconds)
        names = dict(session.plan.in_force)
        label = " + ".join(names[family] for family in CHOSEN)
        self.candidates.append(Candidate(label, Trial(session, choices, names, seconds)))
        return self.candidates[-1]

    def _plan(self, auto: Candidate, pixels: int) -> None:
        """Film and samples of a round, so that the pilot takes its share of the expected render."""
        count = self.small.film.window[2] * self.small.film.window[3]
        auto.render(next(self.seeds), self.spp)
        each = auto.seconds.pop() / (count * self.spp)  # seconds of a sample of a pixel
        auto.images.clear()
        expected = self.time_limit or each * pixels * (self.samples or MAX_SAMPLES)
        self.budget = min(max(SHARE * expected, LEAST_SECONDS), MOST_SECONDS)
        samples = self.budget / (max(self.planned, 1) * each * _TYPICAL)
        least = _LEAST_PATHS / auto.trial.session.plan.jobs_per_sample
        self.spp = 2 ** max(1, round(math.log2(max(samples, least) / count)))
        self.whole = None if self.samples is None else self.samples * pixels / (self.spp * count)

    def _stage(self, family: str, best: Candidate, auto: Candidate) -> Candidate:
        """The best choice of a family, everything else as in `best`."""
        candidates = [best, *self._others(family, best)]
        self.considered[family] = len(candidates)
        while len(candidates) > 1:
            measured = candidates if auto in candidates else [auto, *candidates]
            for turn in range(ROUNDS):
                for n in range(len(measured)):
                    self.render(measured[(n + turn) % len(measured)])
                slow = HOPELESS * auto.seconds[-1]
                measured = [c for c in measured if c in (candidates[0], auto) or c.seconds[-1] < slow]
            kept = halve([c for c in candidates if c in measured], auto, measured)
            self._close([c for c in candidates if c not in kept and c is not auto])
            candidates = kept
            if log.isEnabledFor(logging.INFO):
                log.info("pilot, %s: %s", family, "; ".join(self._figure(c, auto) for c in candidates))
            if self.seconds > self.budget * SPENT[family]:
                break
        return candidates[0]

    def _others(self, family: str, best: Candidate) -> list[Candidate]:
        """Candidates with the family's other choices."""
        if best.trial.session.plan.chosen[family] not in FAMILIES[family]:
            return []  # no majorant is walked
        asked = (best.trial.choices.but(**{family: name}) for name in unbiased(family))
        return list(self.admitted(asked, [best]))

    def admitted(self, asked: Iterable[Choices], among: list[Candidate]) -> Iterator[Candidate]:
        """Candidates of the choices asked for, but for those that cannot be right or are the same as others.

        The same are those that compose the same kernels as one of `among` or of each other.  Candidates are
        like `among[0]` in all that they leave at auto.
        """
        plan = among[0].trial.session.plan
        seen = {self._sources(c.trial.session.plan) for c in among}
        for choices in asked:
            names = {family: choices[family] for family in CHOSEN}
            sources = self._sources(plan.renamed(**{f: n for f, n in names.items() if n != "auto"}))
            if sources not in seen and self._possible(choices) and self._fits(among[0]):
                seen.add(sources)
                yield self._open(choices)

    def _close(self, candidates: list[Candidate]) -> None:
        """Give back the device's memory of those that are out."""
        for candidate in candidates if not self.keep else ():
            candidate.opened = None

    def _fits(self, candidate: Candidate) -> bool:
        """Whether another as large as this fits on the device; what is left out is said."""
        held = [c.opened.session.wavefront.bytes for c in self.candidates if c.opened is not None]
        fits = sum(held) + candidate.trial.session.wavefront.bytes <= self.device.info.global_memory / 2
        if not fits:
            log.warning(
                "the pilot leaves combinations out: %d of them fill half the device's memory", len(held)
            )
        return fits

    def _possible(self, choices: Choices) -> bool:
        try:
            self.plan.having(choices)
        except OptionError:
            return False
        return True

    @staticmethod
    def _sources(plan: Plan) -> tuple[str, ...]:
        return tuple(stage_source(plan, stage) for stage in plan.stages)

    def render(self, candidate: Candidate) -> None:
        """Another round of a candidate, counted and told."""
        candidate.render(next(self.seeds), self.spp)
        self.seconds += candidate.seconds[-1]
        candidate.extra = precomputation(
            candidate.trial.precompute_seconds, candidate.seconds[-1], self.whole, self.time_limit
        )
        self.done += 1
        self.tell(self.done, max(self.planned, self.done))

    def _figure(self, candidate: Candidate, auto: Candidate) -> str:
        return f"{candidate.label} {relative_efficiency(candidate, auto)}"

    def _report(self, best: Candidate, auto: Candidate, relative: Relative) -> Found:
        """The choice, with its reason: auto's rules, unless the best is better beyond chance."""
        stays = best is auto or relative.value < WORTH or relative.low <= 1
        other = f", with {best.label} {relative} times as efficient" if 0 < relative.value != 1 else ""
        if stays:
            best, relative = auto, Relative(1.0, 1.0, 1.0)
        plan, names = best.trial.session.plan, best.trial.session.plan.in_force
        chosen = {f: plan.chosen[f] for f in CHOSEN if plan.chosen[f] in FAMILIES[f]}
        tried = [f"{count} {family}s" for family, count in self.considered.items() if count > 1]
        numbers = " and ".join([", ".join(tried[:-1]), tried[-1]] if tried[1:] else tried)
        if not numbers:
            reason = "this scene leaves nothing to choose"
        elif stays:
            reason = f"auto's own rules stay: nothing is better beyond doubt{other}, of {numbers} tried"
        else:
            reason = f"{relative} times as efficient as auto's {auto.label}, of {numbers} tried"
        if numbers:
            reason += f"; {self.seconds:.1f} s of rendering, {self.kernel_seconds:.1f} s of kernel builds"
        used = {f: n for f, n in chosen.items() if names[f] == n or (f == "transmittance" and plan.nee)}
        options = " ".join(f"{option(family)} {name}" for family, name in used.items())
        return Found(chosen, options, reason, relative, self.seconds, self.kernel_seconds)
