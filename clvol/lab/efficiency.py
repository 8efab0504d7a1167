"""How much error is left for how much work: pure functions on arrays of independent rounds.

Everything rests on one small matrix for each combination (`error_products`): the mean over pixels of the
product of two rounds' errors.  Its diagonal says how large a round's error is; off the diagonal, where
independent noise averages out, only the squared bias is left.  So the error of a mean of any number of rounds
follows without another look at the pictures, and so do its uncertainties, by leaving rounds out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr, stdtrit

from clvol.lab.statistics import Interval

LEAST_ROUNDS = 4
"""Fewer say nothing about tails."""
_ROWS = 64
"""Rows of the picture that are looked at at once, for memory's sake."""


@dataclass(frozen=True)
class Ratio:
    """One efficiency over another.

    Parameters
    ----------
    ratio : how many times more efficient, with its 95 % interval.
    p : two-sided p-value of a ratio of 1.
    """

    ratio: Interval
    p: float


@dataclass(frozen=True, eq=False)
class Work:
    """What the rounds of one combination cost, and the errors they left.

    Parameters
    ----------
    products : float64 (rounds, rounds)
        From `error_products`.
    cost : float64 (rounds,)
        Seconds or look-ups of each round.
    overhead : what was spent once, before the first round, in the same unit.
    biased : whether the estimator is known to be biased.  If not, its bias is taken to be 0, which is more
        precise than measuring it; the test for bias is another matter.
    reference_error : standard error of all `products` in common, from the reference's own error.
    """

    products: np.ndarray
    cost: np.ndarray
    overhead: float = 0.0
    biased: bool = False
    reference_error: float = 0.0

    @property
    def rounds(self) -> int:
        """How many there are."""
        return len(self.cost)

    @property
    def error(self) -> float:
        """Estimated MSE of the mean of all rounds."""
        return float(self._errors(*noise_and_bias(self.products)))

    def log_inverse_efficiency(self) -> float:
        """log(MSE · cost) of the mean of all rounds; nan where there is no error or no cost to speak of."""
        return float(_log_product(self.error, self.overhead + self.cost.sum()))

    def left_out(self) -> np.ndarray:
        """The same, estimated without each of the rounds in turn; float64 (rounds,)."""
        fewer, diagonal = self.rounds - 1, np.diag(self.products)
        trace = diagonal.sum() - diagonal
        pairs = self.products.sum() - 2 * self.products.sum(axis=1) + diagonal - trace
        errors = self._errors(trace / fewer, pairs / (fewer * (fewer - 1)))
        cost = self.overhead + self.rounds / fewer * (self.cost.sum() - self.cost)
        return _log_product(errors, cost)

    def _errors(self, one: np.ndarray | float, bias: np.ndarray | float) -> np.ndarray:
        """MSE of the mean of all rounds, from that of one round and the squared bias."""
        kept = np.maximum(bias, 0.0) if self.biased else 0.0
        errors: np.ndarray = np.asarray(kept + (one - kept) / self.rounds)
        return errors


def _log_product(error: np.ndarray | float, cost: np.ndarray | float) -> np.ndarray:
    """log(error · cost), nan where either is not positive."""
    known = (np.asarray(error) > 0) & (np.asarray(cost) > 0)
    return np.log(np.where(known, error * cost, np.nan))


def error_products(
    rounds: np.ndarray, reference: np.ndarray, variance: np.ndarray, weight: np.ndarray | float = 1.0
) -> np.ndarray:
    """Mean over pixels and channels of (I_i - F)(I_j - F) - V, float64 (rounds, rounds).

    Unbiased for sigma² + bias² on the diagonal and bias² off it, sigma² being the variance of a round.

    Parameters
    ----------
    rounds : float (rounds, height, width, channels)
        I: independent pictures.
    reference : float (height, width, channels)
        F, independent of them.
    variance : float (height, width, channels)
        V: the reference's own variance.
    weight : float (height, width, channels), or a number
        Multiplies every product; 1 / (F² + epsilon) makes relative errors.
    """
    weight = np.broadcast_to(np.asarray(weight, np.float64), reference.shape)
    products = np.zeros((len(rounds), len(rounds)))
    for top in range(0, reference.shape[0], _ROWS):
        rows = slice(top, top + _ROWS)
        errors = rounds[:, rows].astype(np.float64) - reference[rows]
        errors = (errors * np.sqrt(weight[rows])).reshape(len(rounds), -1)
        products += errors @ errors.T
    return products / reference.size - float(np.mean(variance * weight, dtype=np.float64))


def noise_and_bias(products: np.ndarray) -> tuple[float, float]:
    """Mean squared error of one round, and the squared bias, which may come out negative by chance."""
    count = len(products)
    one = float(np.trace(products)) / count
    bias = (float(products.sum()) - count * one) / (count * (count - 1)) if count > 1 else math.nan
    return one, bias


def convergence(products: np.ndarray) -> np.ndarray:
    """MSE of the mean of 1, 2, … rounds, the mean over every order of the rounds; float64 (rounds,)."""
    one, bias = noise_and_bias(products)
    return bias + (one - bias) / np.arange(1, len(products) + 1)


def convergence_bands(products: np.ndarray, resamples: int = 1000, seed: int = 1) -> np.ndarray:
    """Bootstrap over rounds of `convergence`: float64 (resamples, rounds).

    A round drawn twice is no pair of independent rounds; such pairs are left out of the bias.
    """
    count = len(products)
    random = np.random.default_rng(seed)
    times = random.multinomial(count, np.full(count, 1 / count), resamples).astype(np.float64)
    times = times[(times > 0).sum(axis=1) > 1]
    diagonal = np.diag(products)
    one = times @ diagonal / count
    pairs = np.einsum("ri,ij,rj->r", times, products, times) - times**2 @ diagonal
    bias = pairs / (count**2 - (times**2).sum(axis=1))
    curves: np.ndarray = bias[:, None] + (one - bias)[:, None] / np.arange(1, count + 1)
    return curves


def pair_error(pairs: np.ndarray) -> tuple[float, float]:
    """Standard error of the mean of `pairs` off their diagonal, and its degrees of freedom.

    pairs : float64 (rounds, rounds), symmetric: one number for each pair of independent rounds.  What a round
    does to all of its pairs is told from what is a pair's own (analysis of variance): without a bias there is
    only the latter, and the jackknife would then claim twice its variance.

    The variance is that of pairs alone and what rounds have beyond it, a difference of two estimates.  By
    Satterthwaite's formula such a difference has a quarter of the rounds as degrees of freedom where the two
    are near each other, and bands of high level have no end.  But it is never below that of pairs alone,
    which is known well.  So it counts with half as many as rounds by themselves have, at least: simulated
    bands of 95 % then miss in 3 to 5 %.
    """
    count = len(pairs)
    away = pairs - np.diag(np.diag(pairs))
    away -= (away.sum() / (count * (count - 1))) * (1 - np.eye(count))
    by_round = away.sum(axis=1) / (count - 2)
    between = (by_round**2).sum() * (count - 2) / (count - 1)
    own = away - (by_round[:, None] + by_round) * (1 - np.eye(count))
    rest = count * (count - 3) / 2
    within = (own**2).sum() / 2 / rest
    of_rounds = 4 / (count * (count - 2)) if between > within else 0.0
    parts = np.array([of_rounds * between, (2 / (count * (count - 1)) - of_rounds) * within])
    variance = float(parts.sum())
    if variance <= 0:
        return 0.0, rest
    freedom = variance**2 / float((parts**2 / [count - 1, rest]).sum())
    return math.sqrt(variance), max(freedom, min((count - 1) / 2, rest))


def slopes(curves: np.ndarray) -> np.ndarray:
    """Least-squares slope of log(MSE) over log(rounds) of each row.

    Rounds are spread evenly on that axis; the slope is -inf where an MSE comes out as 0 or less.
    """
    places = np.unique(np.geomspace(1, curves.shape[1], 12).round().astype(int))
    values = curves[:, places - 1]
    away = np.log(places) - np.log(places).mean()
    found = np.log(np.maximum(values, np.finfo(float).tiny)) @ away / (away @ away)
    return np.where((values > 0).all(axis=1), found, -math.inf)


def fitted_slope(products: np.ndarray, level: float = 0.95) -> Interval:
    """Slope of the `convergence` of means of separate rounds, and its band: -1 without bias, more with one.

    It follows from the share of the bias in one round's error, and its band from that share's interval; nan
    where there is no error.  At 10 rounds it lies above -1 in 1.3 % of unbiased comparisons and below -1 in
    1.4 % (simulated; rather more with a bias, less with fewer rounds), and below -1 in up to 5 % where rare
    bright pixels make all the noise.
    """
    one, bias = noise_and_bias(products)
    if not one > 0:
        return Interval(math.nan, math.nan, math.nan)
    share, errors = bias / one, np.diag(products)
    error, freedom = pair_error((products - share * (errors[:, None] + errors) / 2) / one)
    shares = share + error * float(stdtrit(freedom, (1 + level) / 2)) * np.array([[0], [-1], [1]])
    return Interval(*slopes(shares + (1 - shares) / np.arange(1, len(products) + 1)).tolist())


def compare_efficiency(ours: Work, theirs: Work, level: float = 0.95) -> Ratio:
    """Our 1 / (MSE · cost) over theirs; rounds of equal number ran one after the other.

    The log of the ratio is jackknifed over pairs of rounds, so that what disturbed both cancels.  Its
    interval is Student's, with fewer degrees of freedom where the rounds have heavy tails (Satterthwaite,
    with the kurtosis of the leave-one-out values).  It covers in 95 % of comparisons where the errors of both
    combinations' rounds spread like a lognormal of sigma 1, and in 91 % where those of one of them alone have
    a Pareto tail of exponent 2.5 (tests/lab/test_efficiency.py).  The reference's error, common to
    both, is added.

    Ratio, ends and p are nan where an error or a cost is unknown.
    """
    count = ours.rounds
    if count != theirs.rounds or count < LEAST_ROUNDS:
        raise ValueError(f"{count} and {theirs.rounds} rounds: at least {LEAST_ROUNDS} pairs are needed")
    ratio = theirs.log_inverse_efficiency() - ours.log_inverse_efficiency()
    left_out = theirs.left_out() - ours.left_out()
    spread = (count - 1) / count * ((left_out - left_out.mean()) ** 2).sum()
    spread += _common_error(ours, theirs) ** 2
    if not (math.isfinite(ratio) and math.isfinite(spread)):
        return Ratio(Interval(math.nan, math.nan, math.nan), math.nan)
    error, freedom = math.sqrt(spread), degrees_of_freedom(left_out)
    reach = error * float(stdtrit(freedom, (1 + level) / 2))
    certain = 1.0 if ratio == 0 else 0.0
    p = 2 * float(stdtr(freedom, -abs(ratio) / error)) if error > 0 else certain
    return Ratio(Interval(*(_exp(ratio + step) for step in (0.0, -reach, reach))), p)


def _common_error(ours: Work, theirs: Work) -> float:
    """Standard error of the log ratio that comes from the reference: it shifts both MSEs by the same."""

    def share(work: Work) -> float:
        moved = 1.0 if work.biased else 1.0 / work.rounds
        error = work.error
        return moved * work.reference_error / error if error > 0 else math.nan

    return abs(share(ours) - share(theirs))


def degrees_of_freedom(values: np.ndarray) -> float:
    """Those of the variance of `values`: their number less one for normal ones, less for heavy tails."""
    count = len(values)
    if count < LEAST_ROUNDS or np.ptp(values) <= 1e-12 * np.abs(values).max():
        return count - 1.0
    away = values - values.mean()
    peaked = count * (away**4).sum() / (away**2).sum() ** 2 - 3
    excess = (
        (count - 1) / ((count - 2) * (count - 3)) * ((count + 1) * peaked + 6)
    )  # unbiased for normal ones
    return 2.0 / (2.0 / (count - 1) + max(float(excess), 0.0) / count)


def largest_share(products: np.ndarray) -> float:
    """Share of the squared error that is in the worst round: 1 / rounds if all are alike."""
    errors = np.maximum(np.diag(products), 0.0)
    return float(errors.max() / errors.sum()) if errors.sum() > 0 else math.nan


def _exp(value: float) -> float:
    """exp, inf instead of an overflow."""
    return math.exp(value) if value < 700 else math.inf
