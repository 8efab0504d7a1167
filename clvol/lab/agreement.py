"""Whether two ways to render a picture agree: tests of its tiles and of its mean, from independent rounds.

A round is one render; rounds are few, but pixels are many and independent of each other.  So the variance of
a tile's mean is pooled: the sum over its pixels of the variance between rounds, whose degrees of freedom are
Satterthwaite's over the pixels of both stacks (Welch's t).  Where one bright pixel makes all the noise they
fall to those of that pixel, so that heavy tails make the test doubtful of itself, not alarmed.

A stack that missed a rare bright sample is darker and looks certain of it.  No difference is therefore held
to be less probable than that the darker stack has missed the samples that make it up: e^-n for n of them,
each as bright as the largest it is known to draw.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr, stdtrit

from clvol.errors import OptionError
from clvol.lab.statistics import region_sums, regions

POWER = 0.95
"""Probability with which `Agreement.smallest_bias` would have been seen."""
ROUNDING = 1e-5
"""Relative error of a mean of float32 samples: a difference of so little is none."""
_CERTAIN = 1e9  # degrees of freedom of a normal distribution


@dataclass(frozen=True)
class Agreement:
    """What the tests of two pictures found.

    Parameters
    ----------
    agrees : neither p-value is below alpha.
    mean_p : of the image mean in each channel and in grey, tile_p : of the tile that deviates most.  Both are
        adjusted for all that was tested, the two kinds of test included: two pictures of the same expectation
        have one of them below alpha with probability alpha at most.
    worst_tile : (x, y), pixel of the image at the upper left of the tile that deviates most.
    smallest_bias : relative bias of the grey image mean, up or down, that would have been detected with
        probability `POWER`; inf for a black picture.
    deviation : the largest difference of all, in standard errors.
    explanation : one sentence.
    """

    agrees: bool
    mean_p: float
    tile_p: float
    worst_tile: tuple[int, int]
    smallest_bias: float
    deviation: float
    explanation: str

    @property
    def p(self) -> float:
        """The smaller p-value."""
        return min(self.mean_p, self.tile_p)


class _Means(NamedTuple):
    """Means over regions of an image, and the variance of one round of each.

    Also the variance of that variance (halved) for a normal distribution: arrays (regions y, regions x,
    planes).

    pixels : of a region, (regions y, regions x, 1).
    largest : what one sample is known to add to a pixel of a round, (planes,).
    """

    mean: np.ndarray
    variance: np.ndarray
    doubt: np.ndarray
    rounds: int
    pixels: np.ndarray
    largest: np.ndarray

    @property
    def unit(self) -> np.ndarray:
        """What the largest sample adds to a region's mean."""
        unit: np.ndarray = self.largest / (self.pixels * self.rounds)
        return unit


class _Tests(NamedTuple):
    """Tests of regions, arrays (regions y, regions x, planes).

    level : mean of both, its absolute value.  unit : what the largest sample adds to the mean of either.
    """

    difference: np.ndarray
    error: np.ndarray
    freedom: np.ndarray
    t: np.ndarray
    p: np.ndarray
    level: np.ndarray
    unit: np.ndarray


def agreement(
    a: np.ndarray,
    b: np.ndarray,
    tile: int = 8,
    alpha: float = 1e-4,
    spp: tuple[float, float] | None = None,
    largest: tuple[float, float] = (0.0, 0.0),
) -> Agreement:
    """Test whether two stacks of renders have the same expectation.

    Parameters
    ----------
    a, b : float (rounds, height, width, channels)
        Independent renders of the same size, at least 2 rounds of each; rounds of `a` and `b` may differ in
        number and in samples.
    tile : edge of a tile in pixels; those at the right and lower edge are what is left.
    alpha : probability of a false alarm, half of it for the tiles and half for the means (Holm).
    spp : samples per pixel in a round of `a` and of `b`.  Give it wherever one stack is much longer than the
        other: the shorter is then taken to be no quieter per sample than the longer, since a few samples that
        have missed a rare bright one believe themselves to be certain, and raise false alarms.
    largest : what a single sample of `a` and of `b` may add to a pixel of a round, where that is known to be
        more than the rounds show.

    Raises
    ------
    OptionError : shapes that differ, fewer than 2 rounds, an alpha that is no probability.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    _check(a, b, tile, alpha)
    broken = int(np.count_nonzero(~np.isfinite(a)) + np.count_nonzero(~np.isfinite(b)))
    if broken:
        return Agreement(False, 0.0, 0.0, (0, 0), math.inf, math.inf, f"{broken} values are not finite")
    a, b = _planes(a, b)
    tiles, image = (
        _welch(_means(a, edge, largest[0]), _means(b, edge, largest[1]), spp)
        for edge in (tile, max(a.shape[1:3]))
    )
    y, x = np.unravel_index(np.argmin(tiles.p), tiles.p.shape)[:2]
    mean_p = min(1.0, 2 * image.p.size * float(image.p.min()))
    tile_p = min(1.0, 2 * tiles.p.size * float(tiles.p.min()))
    bias = _smallest_bias(image, alpha / (2 * image.p.size))
    deviation = max(float(np.abs(tests.t).max()) for tests in (tiles, image))
    worst = int(x) * tile, int(y) * tile
    found = Agreement(min(mean_p, tile_p) >= alpha, mean_p, tile_p, worst, bias, deviation, "")
    return replace(found, explanation=_explanation(found, image, tiles, alpha))


def _check(a: np.ndarray, b: np.ndarray, tile: int, alpha: float) -> None:
    if a.ndim != 4 or a.shape[1:] != b.shape[1:]:
        raise OptionError(
            f"stacks of shape {a.shape} and {b.shape} cannot be compared",
            hint="give (rounds, height, width, channels) of renders of one size",
        )
    if min(len(a), len(b)) < 2:
        raise OptionError("agreement needs at least 2 rounds of each", hint="their differences are the noise")
    if tile < 1 or not 0 < alpha < 1:
        raise OptionError(f"tile {tile}, alpha {alpha}", hint="tile is at least 1, alpha between 0 and 1")


def _planes(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is tested of each pixel: its channels where they differ, and their mean, which comes last."""
    grey = [stack.mean(axis=-1, keepdims=True) for stack in (a, b)]
    if all(np.array_equal(stack, np.broadcast_to(stack[..., :1], stack.shape)) for stack in (a, b)):
        return grey[0], grey[1]
    return np.concatenate([a, grey[0]], axis=-1), np.concatenate([b, grey[1]], axis=-1)


def _means(stack: np.ndarray, edge: int, largest: float) -> _Means:
    """Means of square regions of pixels, with the variance pooled over the pixels of each."""
    rounds, mean, variance = len(stack), stack.mean(axis=0), stack.var(axis=0, ddof=1)
    found = regions(mean, variance, edge)
    doubt = region_sums(variance**2, edge) / (rounds - 1) / found.pixels**4
    excess = (stack - mean).max(axis=(0, 1, 2)) * rounds / (rounds - 1)  # the sample moves the mean too
    return _Means(found.mean, found.variance, doubt, rounds, found.pixels, np.maximum(excess, largest))


def _welch(a: _Means, b: _Means, spp: tuple[float, float] | None) -> _Tests:
    """Two-sided tests of a = b in every region."""
    variance = a.variance / a.rounds + b.variance / b.rounds
    doubt = a.doubt / a.rounds**2 + b.doubt / b.rounds**2
    if spp is not None and a.rounds * spp[0] != b.rounds * spp[1]:
        short, long, ratio = (a, b, spp[1] / spp[0])
        if a.rounds * spp[0] > b.rounds * spp[1]:
            short, long, ratio = (b, a, spp[0] / spp[1])
        quieter = short.variance < ratio * long.variance
        share = ratio / short.rounds + 1 / long.rounds  # both variances are then the longer stack's
        variance = np.where(quieter, long.variance * share, variance)
        doubt = np.where(quieter, long.doubt * share**2, doubt)
    known = doubt > 0
    freedom = np.divide(variance**2, doubt, out=np.full_like(variance, _CERTAIN), where=known)
    level = (np.abs(a.mean) + np.abs(b.mean)) / 2
    error = np.hypot(np.sqrt(variance), ROUNDING * level)
    t = np.divide(a.mean - b.mean, error, out=np.zeros_like(error), where=error > 0)
    p = 2 * stdtr(freedom, -np.abs(t))
    for dark, bright in ((a, b), (b, a)):
        p = np.maximum(p, _missed(dark, bright))
    return _Tests(a.mean - b.mean, error, freedom, t, p, level, np.maximum(a.unit, b.unit))


def _missed(dark: _Means, bright: _Means) -> np.ndarray:
    """Probability of having missed all samples that `dark` lacks, each its largest (Poisson).

    It is 0 where `dark` is not darker.
    """
    lacking, unit = bright.mean - dark.mean, np.broadcast_to(dark.unit, dark.mean.shape)
    known = (lacking > 0) & (unit > 0)
    missed: np.ndarray = np.exp(-np.divide(lacking, unit, out=np.full_like(lacking, math.inf), where=known))
    return missed


def _smallest_bias(image: _Tests, level: float) -> float:
    """Relative bias of the grey mean that a two-sided test of `level` detects with probability POWER."""
    freedom, error, mean, unit = (
        float(x[0, 0, -1]) for x in (image.freedom, image.error, image.level, image.unit)
    )
    if mean == 0:
        return math.inf
    seen = float(stdtrit(freedom, 1 - level / 2) + stdtrit(freedom, POWER)) * error
    return max(seen, math.log(1 / level) * unit + float(stdtrit(freedom, POWER)) * error) / mean


def _explanation(found: Agreement, image: _Tests, tiles: _Tests, alpha: float) -> str:
    """One sentence on what was found."""
    if not image.level.any():
        return "both pictures are black"
    seen = f"a bias of {found.smallest_bias:.2g} of the mean would have been seen"
    of_all, of_one = _difference(image), _difference(tiles)
    if found.agrees:
        return f"the means differ by {of_all.lstrip('+-−')} of the mean at most, which is noise; {seen}"
    if found.mean_p < alpha:
        return f"the image means differ by {of_all} of the mean (p = {found.mean_p:.1g})"
    x, y = found.worst_tile
    return f"the tile at ({x}, {y}) differs by {of_one} of its mean (p = {found.tile_p:.1g})"


def _difference(tests: _Tests) -> str:
    """The relative difference of the region and channel that deviates most."""
    place = np.unravel_index(np.argmin(tests.p), tests.p.shape)
    return f"{tests.difference[place] / max(tests.level[place], 1e-300):+.2g}"
