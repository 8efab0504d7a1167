"""From rounds to figures: errors, efficiencies, slopes and verdicts; nothing here renders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.agreement import Agreement, agreement
from clvol.lab.comparison.equal_time import EqualTime, equal_time
from clvol.lab.comparison.one_render import OneRender, one_render
from clvol.lab.comparison.relative import relative_weight
from clvol.lab.comparison.shorter import render_slope, slope_spp
from clvol.lab.efficiency import (
    Work,
    compare_efficiency,
    convergence,
    convergence_bands,
    error_products,
    fitted_slope,
    largest_share,
)
from clvol.lab.statistics import Interval, holm

if TYPE_CHECKING:
    from clvol.lab.comparison.measure import Measured
    from clvol.lab.comparison.reference import Reference

LEVEL = 0.05
"""Probability that any of the efficiencies of one kind is called significantly different though it is not."""
ALPHA = 1e-4
"""Probability that an unbiased combination is called biased."""
COSTS = {"seconds": "time", "lookups": "look-ups"}


@dataclass(frozen=True, eq=False)
class Curve:
    """An error over the rounds, float64 (rounds,) each.

    The MSE of the mean of 1, 2, … rounds, over every order of the rounds, and the ends of its 95 % bootstrap
    band, which may be negative.
    """

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Efficiency:
    """1 / (MSE · cost) of the mean of all rounds, precomputation counted where cost is seconds.

    It holds for renders of as many samples as a round: samplers sobol and joint gain with their number.

    Parameters
    ----------
    value : in 1 / (radiance² · unit of cost).
    ratio : over the baseline's, with its 95 % interval; 1 for the baseline itself.
    p, adjusted_p : two-sided, of a ratio of 1; alone, and by Holm's method for all combinations compared.
    significant : whether the adjusted one is below `LEVEL`.
    """

    value: float
    ratio: Interval
    p: float
    adjusted_p: float
    significant: bool


@dataclass(frozen=True)
class LargestError:
    """The pixel of the mean of all rounds that is furthest from the reference.

    Its place, its difference, and that in standard errors of the reference and the rounds.
    """

    x: int
    y: int
    channel: str
    difference: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Figures:
    """What was found of one combination.

    Attributes
    ----------
    measured
        Its rounds, as they were rendered.
    picture
        Its picture at equal time, with what it differs by from the reference.
    one_render
        The relative error of one render over its samples.
    mse, relmse
        The absolute and the relative error over the rounds.
    seconds, lookups
        float64 (rounds,): spent for the mean of 1, 2, … rounds, precomputation counted.
    slope
        Of the MSE of means of separate renders over their number, with its band; -1 without bias.
    render_slope
        Of the MSE of one render over its samples, with its 95 % interval; -1 for independent samples without
        bias, nan where there are too few.
    squared_bias, relative_squared_bias
        Estimates, which may be negative by chance.
    efficiency
        By kind of cost: "seconds" and, where the density is looked up at all, "lookups".
    worst_round
        Share of the squared error that one round has.
    largest_error
        Where the mean of all rounds is furthest from the reference.
    verdict
        Tests against the reference, tile by tile and of the mean.
    """

    measured: Measured
    picture: EqualTime
    one_render: OneRender
    mse: Curve
    relmse: Curve
    seconds: np.ndarray
    lookups: np.ndarray
    slope: Interval
    render_slope: Interval
    squared_bias: float
    relative_squared_bias: float
    efficiency: dict[str, Efficiency]
    worst_round: float
    largest_error: LargestError
    verdict: Agreement

    @property
    def label(self) -> str:
        """How the combination is called in this comparison."""
        return self.measured.label

    @property
    def biased(self) -> bool:
        """Whether it is labelled as biased."""
        return self.measured.trial.biased

    @property
    def image(self) -> np.ndarray:
        """Mean of all rounds, float64 (height, width, 3)."""
        mean: np.ndarray = self.measured.images.mean(axis=0, dtype=np.float64)
        return mean


def compute_figures(measured: list[Measured], reference: Reference, baseline: str) -> tuple[Figures, ...]:
    """All figures of all combinations."""
    per_round = reference.round_spp
    weight = relative_weight(reference.image)
    products = {m.label: error_products(m.images, reference.image, reference.variance) for m in measured}
    works = {
        cost: {m.label: _work(m, products[m.label], cost, reference) for m in measured} for cost in COSTS
    }
    efficiency = {cost: _efficiencies(by_label, baseline) for cost, by_label in works.items()}
    return tuple(
        Figures(
            m,
            equal_time(m.picture, reference, weight),
            one_render(m, reference, weight),
            _curve(products[m.label]),
            _curve(relative := error_products(m.images, reference.image, reference.variance, weight)),
            m.trial.precompute_seconds + _running(m.seconds),
            _running(m.lookups),
            fitted_slope(products[m.label]),
            _render_slope(m, products[m.label], reference),
            _bias(products[m.label]),
            _bias(relative),
            {cost: found[m.label] for cost, found in efficiency.items() if m.label in found},
            largest_share(products[m.label]),
            _largest_error(m, reference),
            agreement(
                m.images,
                reference.rounds,
                alpha=ALPHA,
                spp=(m.spp, per_round) if per_round else None,
            ),
        )
        for m in measured
    )


def _running(cost: np.ndarray) -> np.ndarray:
    return np.arange(1, len(cost) + 1) * float(cost.mean())


def _curve(products: np.ndarray) -> Curve:
    low, high = np.quantile(convergence_bands(products), [0.025, 0.975], axis=0)
    return Curve(convergence(products), low, high)


def _render_slope(measured: Measured, products: np.ndarray, reference: Reference) -> Interval:
    errors = {measured.spp: np.diag(products)}
    for spp in slope_spp(measured.spp):
        if spp in measured.shorter:
            images = measured.shorter[spp].images
            errors[spp] = np.diag(error_products(images, reference.image, reference.variance))
    return render_slope(errors)


def _bias(products: np.ndarray) -> float:
    count = len(products)
    return float(products.sum() - np.trace(products)) / (count * (count - 1))


def _work(measured: Measured, products: np.ndarray, cost: str, reference: Reference) -> Work:
    overhead = measured.trial.precompute_seconds if cost == "seconds" else 0.0
    spent = getattr(measured, cost)
    return Work(products, spent, overhead, measured.trial.biased, reference.product_error)


def _efficiencies(works: dict[str, Work], baseline: str) -> dict[str, Efficiency]:
    """By label, without those that cost nothing; none at all where that is the baseline."""
    costly = {label: work for label, work in works.items() if work.cost.any()}
    if baseline not in costly:
        return {}
    ratios = {
        label: compare_efficiency(work, works[baseline])
        for label, work in costly.items()
        if label != baseline
    }
    adjusted = dict(zip(ratios, holm(np.array([r.p for r in ratios.values()])), strict=True))
    found = {}
    for label, work in costly.items():
        value = math.exp(-work.log_inverse_efficiency())
        if label == baseline:
            found[label] = Efficiency(value, Interval(1.0, 1.0, 1.0), math.nan, math.nan, False)
        else:
            p = float(adjusted[label])
            found[label] = Efficiency(value, ratios[label].ratio, ratios[label].p, p, p < LEVEL)
    return found


def _largest_error(measured: Measured, reference: Reference) -> LargestError:
    images = measured.images
    difference = images.mean(axis=0, dtype=np.float64) - reference.image
    y, x, channel = np.unravel_index(np.argmax(np.abs(difference)), difference.shape)
    place = (y, x, channel)
    own = float(images[:, y, x, channel].var(ddof=1, dtype=np.float64)) / len(images)
    error = math.sqrt(own + float(reference.variance[place]))
    value = float(difference[place])
    return LargestError(int(x), int(y), "RGB"[channel], value, value / error if error > 0 else math.nan)
