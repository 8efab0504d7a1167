"""What a film adds up, and the mean and variance that follow from it.

Independent samples leave their sum and that of their squares.  Low-discrepancy samples depend on each other,
so that their squares say nothing of the mean's error: they are drawn in several independent randomisations,
whose sums are kept apart (Owen 1997, "Monte Carlo variance of scrambled net quadrature", section 3).  Where
these are parts of one sequence (sampler joint) they vary more than their mean lets expect, as strata do: the
variance found is then too large by minus the mean covariance of two parts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from clvol.errors import OptionError, option

Ranges = tuple[tuple[int, int], ...]
"""Sample ranges as (first, count), ascending, disjoint, not touching."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over independent samples.

    Parameters
    ----------
    sum_, sum_of_squares : float64, any shape
        Over the samples, and over their squares.
    count : int
        How many samples, at least 1.
    """

    sum_: np.ndarray
    sum_of_squares: np.ndarray
    count: int

    @property
    def dof(self) -> int:
        """Degrees of freedom of the variance."""
        return self.count - 1

    def mean_and_variance(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and the variance of that mean, (S2 - S1²/n) / (n (n - 1)) >= 0; inf for a single sample."""
        mean = self.sum_ / self.count
        if self.count < 2:
            return mean, np.full_like(mean, np.inf)
        spread = np.maximum(self.sum_of_squares - self.sum_ * mean, 0.0)
        return mean, spread / (self.count * (self.count - 1.0))

    def plus(self, other: Moments) -> Moments:
        """Of both sets of samples."""
        return Moments(
            self.sum_ + other.sum_, self.sum_of_squares + other.sum_of_squares, self.count + other.count
        )

    def reshaped(self, *shape: int) -> Moments:
        """The same in another shape, broadcast to it."""
        return Moments(_fit(self.sum_, shape), _fit(self.sum_of_squares, shape), self.count)


@dataclass(frozen=True, eq=False)
class Replicates:
    """Sums over the samples of each of several independent randomisations.

    Parameters
    ----------
    sums : float64 (randomisations, …)
    counts : int64 (randomisations,)
        Samples of each; some may have none.
    """

    sums: np.ndarray
    counts: np.ndarray

    @property
    def count(self) -> int:
        """Samples in all."""
        return int(self.counts.sum())

    @property
    def sum_(self) -> np.ndarray:
        """Over all samples, float64 (…)."""
        total: np.ndarray = self.sums.sum(axis=0)
        return total

    @property
    def dof(self) -> int:
        """Degrees of freedom of the variance."""
        return int((self.counts > 0).sum()) - 1

    def mean_and_variance(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean, and its variance by the scatter of the randomisations' means; inf where there is only one."""
        mean = self.sum_
        mean /= self.count
        if self.dof < 1:
            return mean, np.full_like(mean, np.inf)
        variance, deviation = np.zeros_like(mean), np.empty_like(mean)
        for total, count, weight in zip(self.sums, self.counts, self._weights(), strict=True):
            if count:  # in place: large pictures are short of memory just here
                np.divide(total, count, out=deviation)
                deviation -= mean
                deviation *= deviation
                deviation *= weight
                variance += deviation
        return mean, variance

    def _weights(self) -> np.ndarray:
        """What each randomisation's squared deviation counts for; float64 (randomisations,).

        A mean m = Σ w m_r of independent means has E (m_r - m)² = (1 - 2 w_r) v_r + Σ w² v: the weights
        w² / ((1 - 2 w) (1 + Σ w² / (1 - 2 w))) make Σ w² v of these whatever the v are, so that it does not
        matter how much better 8 low-discrepancy samples are than 7.  That asks for w < 1/2; else the weights
        are those that are right where v falls as 1 / samples.
        """
        shares = self.counts / self.count
        if shares.max() < 0.5:
            weights = shares**2 / (1 - 2 * shares)
            weights /= 1 + weights.sum()
        else:
            weights = shares / self.dof
        return weights

    def plus(self, other: Replicates) -> Replicates:
        """Of further samples of the same randomisations."""
        return Replicates(self.sums + other.sums, self.counts + other.counts)

    def reshaped(self, *shape: int) -> Replicates:
        """The same in another shape, broadcast to it."""
        parts = len(self.sums)
        flat = np.broadcast_to(self.sums, (*self.sums.shape[:-1], shape[-1]))
        return Replicates(flat.reshape(parts, *shape), self.counts)


@dataclass(frozen=True, eq=False)
class Uneven:
    """Means that no further samples can be added to, as where each pixel has a number of samples of its own.

    Parameters
    ----------
    mean, variance : float64 (pixels, …)
        The variance is the mean's; inf where it is unknown.
    counts : int64 (pixels,)
    dof : int
        Least degrees of freedom of a pixel's variance.
    reason, hint : str
        Why that is, and what helps.
    """

    mean: np.ndarray
    variance: np.ndarray
    counts: np.ndarray
    dof: int
    reason: str = "results of a target error do not merge"
    hint: str = f"ask for a lower {option('target_error')}, or render ranges of samples without one"

    def mean_and_variance(self) -> tuple[np.ndarray, np.ndarray]:
        """As they are."""
        return self.mean, self.variance

    def plus(self, other: Estimate) -> NoReturn:
        """No: OptionError."""
        raise OptionError(self.reason, hint=self.hint)

    def reshaped(self, *shape: int) -> Uneven:
        """The same in another shape, broadcast to it."""
        return replace(self, mean=_fit(self.mean, shape), variance=_fit(self.variance, shape))


Estimate = Moments | Replicates | Uneven


def _fit(array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(pixels, 1 or channels) as (…, channels), float64."""
    flat = np.broadcast_to(array, (array.shape[0], shape[-1]))
    return flat.reshape(shape)


def error_bias(dof: float) -> float:
    """Mean of a standard error estimated with `dof` degrees of freedom over the true one.

    For normal means (known as c4): 0.80 for 1, 0.92 for 3.
    """
    if dof < 1:
        return math.nan
    if dof > 1000:
        return 1.0
    return math.sqrt(2 / dof) * math.exp(math.lgamma((dof + 1) / 2) - math.lgamma(dof / 2))
