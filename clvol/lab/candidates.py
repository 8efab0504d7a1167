"""What a pilot measures of each combination, and how it compares them by 1 / (variance · seconds).

All combinations have the same expectation.  One that missed rare samples of much light shows little variance
and a picture too dark, and would look the better for it: what it lacks beside the others counts as its error.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.agreement import ROUNDING
from clvol.lab.digits import with_ends
from clvol.lab.statistics import Interval, bootstrap, regions, round_variance
from clvol.rendering.doubts import LARGE_WEIGHT
from clvol.rendering.outcome import make_result

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.device.device import Device
    from clvol.lab.trials import Trial

DEVIATIONS, TILE_DEVIATIONS = 3.0, 4.0
"""By so many standard errors a picture's mean, and one of its many tiles, may be darker than another's."""
MOST = 1e6
"""Largest ratio of efficiencies that is told from any other."""
_TILE = 8  # edge in pixels
_LATE = 1000.0  # precomputation that leaves no time counts as if it left this part of it


def clock(device: Device) -> float:
    """Seconds of this process where it renders on a processor, of the wall clock elsewhere.

    Other programs on the processor so do not count.  Its threads all count: renders keep them busy,
    precomputation one.
    """
    return time.process_time() if device.is_cpu else time.perf_counter()


@dataclass(eq=False)
class Candidate:
    """A combination of the pilot and its rounds.

    Parameters
    ----------
    label : the choices of `CHOSEN` in force.  opened : None once its memory is given back.
    images : float32 (height, width, channels) of each round.  seconds : of each round.
    extra : seconds that precomputation adds to a round, see `precomputation`.
    largest_weight : of any round.
    """

    label: str
    opened: Trial | None
    images: list[np.ndarray] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    extra: float = 0.0
    largest_weight: float = 1.0

    @property
    def trial(self) -> Trial:
        """What renders it, while it is open."""
        if self.opened is None:
            raise ValueError(f"{self.label} is closed")
        return self.opened

    @property
    def heavy(self) -> bool:
        """Whether its weights grew so large that it is noisier than its rounds show."""
        return self.largest_weight > LARGE_WEIGHT

    @property
    def variance(self) -> np.ndarray:
        """Of a round, the mean over channels, between rounds; float64 (pixels,)."""
        return round_variance(np.asarray(self.images)).ravel()

    def since(self, first: int) -> Candidate:
        """With the rounds from the given one on alone."""
        return replace(self, images=self.images[first:], seconds=self.seconds[first:])

    def render(self, seed: int, spp: int) -> None:
        """Render another round.  A processor's seconds are those of its `clock` over its threads."""
        session = self.trial.session
        session.restart(seed)
        started = clock(session.device)
        done = session.run(0, spp)
        spent = clock(session.device) - started
        result = make_result(session, 0, done)
        self.images.append(result.image)
        self.largest_weight = max(self.largest_weight, result.stats["largest_weight"])
        self.seconds.append(spent / (session.device.info.compute_units if session.device.is_cpu else 1))


class Relative(Interval):
    """An efficiency over another's, with its 95 % interval."""

    def __str__(self) -> str:
        return with_ends(self)


def blind(one: Candidate, other: Candidate) -> bool:
    """Whether `one` saw nothing of what the other sees.

    All its rounds then are the same picture, to which the other's samples only ever add light.
    """
    if one.variance.any():
        return False
    added = np.asarray(other.images, np.float64) - one.images[0]
    rounding = ROUNDING * max(float(np.abs(images).max()) for images in (other.images, one.images[0]))
    return bool(added.max() > rounding and added.min() >= -rounding)


def shortfall(one: Candidate, other: Candidate) -> float:
    """Variance of a round of `one`, the mean over pixels, that the light it lacks beside `other` tells of.

    Both have the same expectation, so that light which one has and the other lacks beyond their noise is in
    rare samples that the darker one missed.  Were it a single sample, in a region of n pixels and R rounds,
    a mean short by d would tell of a variance of n · R · d² in a pixel of a round; it is so much at least.
    """
    found = 0.0
    certain = blind(one, other)
    stacks = [np.asarray(candidate.images, np.float64) for candidate in (one, other)]
    moments = [(stack.mean(axis=0), stack.var(axis=0, ddof=1)) for stack in stacks]
    for edge, deviations in ((_TILE, TILE_DEVIATIONS), (max(stacks[0].shape[1:3]), DEVIATIONS)):
        mine, its = (regions(*pair, edge) for pair in moments)
        variance = mine.variance / len(stacks[0]) + its.variance / len(stacks[1])
        known = 0.0 if certain else deviations * np.sqrt(variance)
        rounding = ROUNDING * np.maximum(np.abs(mine.mean), np.abs(its.mean))
        lacking = np.maximum(its.mean - mine.mean - known - rounding, 0.0)
        missed = mine.pixels * len(stacks[0]) * lacking**2
        found = max(found, float((missed * mine.pixels).sum() / (mine.pixels.sum() * missed.shape[-1])))
    return found


def error(one: Candidate, others: Sequence[Candidate]) -> np.ndarray:
    """Variance of a round of `one`, raised by what it lacks beside any of the others; float64 (pixels,)."""
    return one.variance + max((shortfall(one, other) for other in others if other is not one), default=0.0)


def inverse_efficiency(variance: np.ndarray, seconds: np.ndarray, extra: float) -> float:
    """Mean variance of a round · (seconds of a round + what precomputation adds to each).

    The seconds are the rounds' median, which does not fall with their number.
    """
    return float(variance.mean() * (np.median(seconds) + extra))


def relative_efficiency(one: Candidate, other: Candidate, resamples: int = 400) -> Relative:
    """Efficiency of one over the other's: its interval is a bootstrap over pixels and over rounds."""
    if one is other:
        return Relative(1.0, 1.0, 1.0)
    sides = [
        (error(candidate, [beside]), np.array(candidate.seconds), candidate.extra)
        for candidate, beside in ((other, one), (one, other))
    ]
    pixels = len(sides[0][0])

    def drawn(random: np.random.Generator) -> float:
        at = random.integers(pixels, size=pixels)
        parts = [inverse_efficiency(v[at], random.choice(s, len(s)), extra) for v, s, extra in sides]
        return _quotient(*parts)

    value = _quotient(*(inverse_efficiency(*side) for side in sides))
    return Relative(value, *bootstrap(drawn, resamples))


def _quotient(a: float, b: float) -> float:
    """The quotient a / b, at most `MOST` and at least its inverse; 1 of zeros: black pictures are alike."""
    return 1.0 if a == b else min(max(a / b, 1 / MOST), MOST) if b > 0 else MOST


def precomputation(seconds: float, render_seconds: float, rounds: float | None, limit: float | None) -> float:
    """Seconds that precomputation adds to a pilot's round, in proportion to the requested render.

    Parameters
    ----------
    seconds : of precomputation.  render_seconds : of the round.
    rounds : how many rounds the render is worth; None where `limit` seconds end it.
    """
    if rounds is not None:
        return seconds / rounds
    if limit is None:
        raise ValueError("a render ends by its rounds or by its seconds")
    left = max(limit - seconds, limit / _LATE)
    return render_seconds * (limit / left - 1)


def doubtful(one: Candidate, auto: Candidate, measured: Sequence[Candidate]) -> bool:
    """Whether it is noisier than its rounds show: blind, or of large weights where auto's choice is not."""
    return one.heavy > auto.heavy or any(blind(one, other) for other in measured)


def halve(candidates: list[Candidate], auto: Candidate, measured: Sequence[Candidate]) -> list[Candidate]:
    """The better half, rounded up, best first; of two, one.

    Better are the more efficient by what all the measured ones show, and those that are not doubtful.
    """
    cost = {
        id(c): (
            doubtful(c, auto, measured),
            inverse_efficiency(error(c, measured), np.array(c.seconds), c.extra),
        )
        for c in candidates
    }
    return sorted(candidates, key=lambda c: cost[id(c)])[: (len(candidates) + 1) // 2]
