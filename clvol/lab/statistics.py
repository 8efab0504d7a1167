"""What self-tests, pilots and comparisons compute alike from independent rounds: pure functions on arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True)
class Interval:
    """An estimate and the ends of its interval, 95 % unless its maker says otherwise."""

    value: float
    low: float
    high: float


class Regions(NamedTuple):
    """Means over square regions of an image: arrays (regions y, regions x, channels).

    mean : over the region and all rounds.
    variance : of a round's mean over the region, pooled over its pixels.
    pixels : of a region, (regions y, regions x, 1).
    """

    mean: np.ndarray
    variance: np.ndarray
    pixels: np.ndarray


def round_variance(images: np.ndarray) -> np.ndarray:
    """Variance of a round, told between rounds, the mean over channels.

    images : float (rounds, height, width, channels), at least 2 rounds; returns float64 (height, width).
    """
    variance: np.ndarray = np.var(images, axis=0, ddof=1, dtype=np.float64).mean(axis=-1)
    return variance


def region_sums(plane: np.ndarray, edge: int) -> np.ndarray:
    """Sums over squares of edge² pixels; (height, width, …) to (regions y, regions x, …)."""
    rows = np.add.reduceat(plane, np.arange(0, plane.shape[0], edge), axis=0)
    return np.add.reduceat(rows, np.arange(0, plane.shape[1], edge), axis=1)


def regions(mean: np.ndarray, variance: np.ndarray, edge: int) -> Regions:
    """Squares of edge² pixels, less at the borders.

    mean, variance : of a round, told from the rounds, float64 (height, width, channels).
    """
    pixels = region_sums(np.ones((*mean.shape[:2], 1)), edge)
    return Regions(region_sums(mean, edge) / pixels, region_sums(variance, edge) / pixels**2, pixels)


def bootstrap(draw: Callable[[np.random.Generator], float], resamples: int) -> tuple[float, float]:
    """Ends of the 95 % interval of a statistic; `draw` computes it from a sample of its measurements."""
    random = np.random.default_rng(1)
    low, high = np.quantile([draw(random) for _ in range(resamples)], [0.025, 0.975])
    return float(low), float(high)


def holm(p_values: np.ndarray) -> np.ndarray:
    """p-values adjusted for their number by Holm's step-down method; nan stays nan and does not count."""
    p_values = np.asarray(p_values, np.float64)
    adjusted = np.full_like(p_values, np.nan)
    known = np.flatnonzero(np.isfinite(p_values))
    order = known[np.argsort(p_values[known])]
    steps = p_values[order] * np.arange(len(order), 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0) if len(order) else []
    return adjusted
