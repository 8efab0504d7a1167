"""How efficient a renderer is, from several renders of one scene: pure functions on arrays.

Efficiency is 1 / (variance per sample x seconds per sample).  The variance is the one *between* renders of
different seeds, so that no renderer has to be believed about its own noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.statistics import bootstrap, round_variance

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, eq=False)
class Rounds:
    """Renders of one scene by one program.

    Parameters
    ----------
    images : float (rounds, height, width, channels)
        Means of `spp` samples, each round of its own seed; at least 2 rounds.
    cpu : float (rounds,)
        CPU seconds of each render.
    spp : int
        Samples per pixel of one round.
    """

    images: np.ndarray
    cpu: np.ndarray
    spp: int

    @classmethod
    def of(cls, renders: Sequence[tuple[np.ndarray, float]], spp: int) -> Rounds:
        """Of the image and the CPU seconds of each."""
        images, cpu = zip(*renders, strict=True)
        return cls(np.stack(images), np.array(cpu), spp)

    @property
    def paths(self) -> int:
        """Samples in one round, over all pixels."""
        return self.spp * self.images.shape[1] * self.images.shape[2]


def pixel_variance(rounds: Rounds) -> np.ndarray:
    """Unbiased variance of one sample: between rounds x spp, mean over channels; (height, width)."""
    return round_variance(rounds.images) * rounds.spp


def image_mean(rounds: Rounds) -> tuple[float, float]:
    """Mean over rounds, pixels and channels, and its standard error (pixels are independent)."""
    grey = rounds.images.astype(np.float64).mean(axis=-1)
    count, pixels = len(grey), grey[0].size
    return float(grey.mean()), math.sqrt(grey.var(axis=0, ddof=1).sum() / count) / pixels


def z_score(first: tuple[float, float], second: tuple[float, float]) -> float:
    """Difference of two (mean, standard error) in standard errors; 0 where both are equal and exact."""
    difference, error = first[0] - second[0], math.hypot(first[1], second[1])
    if error == 0:
        return 0.0 if difference == 0 else math.copysign(math.inf, difference)
    return difference / error


def efficiencies(rounds: Rounds) -> np.ndarray:
    """Efficiency by each round's time, with the variance between all rounds; (rounds,)."""
    return rounds.paths / (pixel_variance(rounds).mean() * rounds.cpu)


def efficiency_ratio(ours: Rounds, theirs: Rounds, resamples: int = 1000) -> dict[str, float]:
    """Our efficiency over theirs: median, least and greatest over the rounds, and a 95 % interval.

    Rounds are compared in pairs that ran one after the other.  The interval is a bootstrap over pixels
    (for the variances) and over pairs of rounds (for the times).
    """
    by_round = efficiencies(ours) / efficiencies(theirs)
    variances = np.stack([pixel_variance(theirs).ravel(), pixel_variance(ours).ravel()])
    times = (theirs.cpu / theirs.paths) / (ours.cpu / ours.paths)

    def drawn(random: np.random.Generator) -> float:
        noise = variances[:, random.integers(variances.shape[1], size=variances.shape[1])].mean(axis=1)
        return noise[0] / noise[1] * np.median(random.choice(times, len(times)))

    low, high = bootstrap(drawn, resamples)
    return spread(by_round) | {"low": low, "high": high}


def spread(values: list[float] | np.ndarray) -> dict[str, float]:
    """Median, least and greatest."""
    return {
        "median": float(np.median(values)),
        "least": float(np.min(values)),
        "greatest": float(np.max(values)),
    }
