"""What a pilot measures of each combination, and how it compares them by 1 / (variance · seconds)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np

from clvol.measure.trials import Trial


@dataclass(eq=False)
class Candidate:
    """A combination of the pilot and its rounds.

    Parameters
    ----------
    label : the choices of `CHOSEN` in force.
    images : float32 (height, width, channels) of each round.  seconds : of each round.
    extra : seconds that precomputation adds to a round, see `precomputation`.
    """

    label: str
    trial: Trial
    images: list[np.ndarray] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    extra: float = 0.0

    @property
    def variance(self) -> np.ndarray:
        """Of a round, the mean over channels, between rounds; float64 (pixels,)."""
        return np.var(self.images, axis=0, ddof=1, dtype=np.float64).mean(axis=-1).ravel()

    def render(self, seed: int, spp: int) -> None:
        """Render another round.  A processor's seconds are its own, divided over its threads: other programs
        that run on it do not count."""
        session = self.trial.session
        session.restart(seed)
        started = time.process_time()
        done = session.run(0, spp, None, None, lambda: False)
        own = (time.process_time() - started) / session.device.info.compute_units
        self.images.append(session.result(0, done).image)
        self.seconds.append(own if session.device.is_cpu else session.seconds)


@dataclass(frozen=True)
class Relative:
    """An efficiency over another's, with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


def inverse_efficiency(variance: np.ndarray, seconds: np.ndarray, extra: float) -> float:
    """Mean variance of a round · (seconds of a round + what precomputation adds to each).

    The seconds are those of the round that was least disturbed: on a busy machine others vary by half.
    """
    return float(variance.mean() * (np.min(seconds) + extra))


def relative_efficiency(one: Candidate, other: Candidate, resamples: int = 400) -> Relative:
    """Efficiency of one over the other's: its interval is a bootstrap over pixels and over rounds."""
    if one is other:
        return Relative(1.0, 1.0, 1.0)
    random = np.random.default_rng(1)
    sides = []
    for candidate in (other, one):
        sides.append((candidate.variance, np.array(candidate.seconds), candidate.extra))
    pixels = len(sides[0][0])
    drawn = np.empty(resamples)
    for n in range(resamples):
        at = random.integers(pixels, size=pixels)
        parts = [inverse_efficiency(v[at], random.choice(s, len(s)), extra) for v, s, extra in sides]
        drawn[n] = _quotient(*parts)
    value = _quotient(*(inverse_efficiency(*side) for side in sides))
    return Relative(value, *(float(q) for q in np.quantile(drawn, (0.025, 0.975))))


def _quotient(a: float, b: float) -> float:
    """a / b, of which neither may be known to be more than 0: black pictures are all alike."""
    return 1.0 if a == b else a / b if b > 0 else math.inf


def precomputation(seconds: float, render_seconds: float, rounds: float | None, limit: float | None) -> float:
    """Seconds that precomputation adds to a pilot's round, in proportion to the requested render.

    Parameters
    ----------
    seconds : of precomputation.  render_seconds : of the round.
    rounds : how many rounds the render is worth; None where `limit` seconds end it.
    """
    if rounds is not None:
        return seconds / rounds
    left = limit - seconds
    return render_seconds * (limit / left - 1) if left > 0 else math.inf


def halve(candidates: list[Candidate]) -> list[Candidate]:
    """The more efficient half, rounded up, best first; of two, one."""
    ranked = sorted(candidates, key=lambda c: inverse_efficiency(c.variance, np.array(c.seconds), c.extra))
    return ranked[: (len(ranked) + 1) // 2]
