"""Controls: the part of a medium's density that trackers treat without look-ups, cell by cell.

Decomposition tracking (Kutz et al. 2017) subtracts a control before it looks anything up, and residual ratio
tracking (Novák et al. 2014) integrates one in closed form.  All functions go from arrays (..., channels) of
a cell's minimum, maximum and mean to arrays, in the volume's units; the scalar majorant that all channels
share is the largest maximum, times `majorant_scale`, a factor (1 except in experiments) that makes bounds
loose or breaks them.
"""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np

from clvol.accel.bounds import over_channels

Control = Literal["none", "min", "fitted"]
"""What decomposition subtracts: nothing; the minimum (analog, needs a lower bound of every value); or
somewhat more (weighted), as far as the weights allow."""
ResidualControl = Literal["mean", "min", "max"]
"""What residual ratio tracking integrates in closed form."""

CONSTANT = np.float32(2.0**-18)
"""Extrema that differ by no more than this fraction bound a constant; slack for rounding takes half of it."""
WEIGHT_GROWTH = np.float32(0.003)
"""How far a fitted control may exceed the density, on the mean, as a share of it.  On cloud.xml the mean
itself as control gave weights of 1e5 (grid) to 1e14 (kd-tree), where 0.003 gives 1.05 and 1.16; ten times as
much saves 5 % of the look-ups and costs a quarter (grid) to two thirds (kd-tree) of the efficiency."""
LONGEST_GROWTH = 8.0
"""Along the longest way through a medium no control lets the second moment of an estimate grow by more than
exp(LONGEST_GROWTH), even where the density is nowhere above its cells' minimum.  With residual ratio tracking
variance times look-ups is 0.35 (kd-tree) and 0.95 (grid) times that without a limit on cloud.xml, 0.92 and
1.02 times on smoke.xml; limits of 2, 4 and 32 are no better on the whole."""
_LARGEST_SHARE = np.float32(0.9)
_LEAST_SPREAD = 2.0**-20
"""Interpolation rounds: a look-up in a constant cell may differ from its value by this fraction."""


class CellBounds(Protocol):
    """Anything that holds extrema and perhaps means of cells: Bounds, KdTree, the boxes it is built of."""

    @property
    def minimum(self) -> np.ndarray:
        """Lower bounds, float32 (..., channels)."""

    @property
    def maximum(self) -> np.ndarray:
        """Upper bounds."""

    @property
    def mean(self) -> np.ndarray | None:
        """Means, where there are any."""


def scaled_majorant(maximum: np.ndarray, majorant_scale: float = 1.0) -> np.ndarray:
    """The bound that all channels share, times `majorant_scale`, rounded up: float32 (...)."""
    majorant = over_channels(maximum, np.maximum)
    return majorant if majorant_scale == 1 else _rounded_up(majorant * np.float64(majorant_scale))


def control(
    minimum: np.ndarray,
    maximum: np.ndarray,
    mean: np.ndarray | None,
    kind: Control,
    majorant_scale: float = 1.0,
    longest: np.ndarray | None = None,
) -> np.ndarray:
    """What decomposition tracking subtracts in each cell: float32 (..., channels), 0 .. scaled majorant.

    `mean` is needed for the kind "fitted" only.  Where the control c exceeds the density, a residual event
    multiplies the path's weight by up to 1 + 2 (c - sigma_t) / (sigma_maj - c): the second moment of the
    weights grows as exp(4 ∫ (c - sigma_t)⁺) along a path, at most as the square of that.  So c is the least
    of four: the cell's mean; the value up to which the mean of (c - sigma_t)⁺, at worst, is WEIGHT_GROWTH of
    the mean density (the worst is a density that knows only its extrema); (minimum + sigma_maj) / 2, which
    keeps each factor within 3; and 0.9 sigma_maj, since at c = sigma_maj the events of the residual would
    have probability 0 and coefficients that are not, which is bias (METHODS §3), also where
    `majorant_scale` < 1 breaks the bound.  Where `longest`, float64 (channels,), gives the optical depth at
    density 1 of the longest way through the medium, c exceeds the minimum by no more than LONGEST_GROWTH
    allows there.  Where a cell is constant the residual is rounding, which the gap left by
    `with_slack` covers, and the mean itself saves every look-up but those that hit the gap.
    """
    if kind == "none":
        return np.zeros_like(minimum)
    majorant = scaled_majorant(maximum, majorant_scale)[..., None]
    if kind == "min":
        least: np.ndarray = np.minimum(minimum, majorant)
        return least
    if kind != "fitted":
        raise ValueError(f"no control {kind!r}")
    if mean is None:
        raise ValueError("a fitted control needs means")
    half = np.float32(0.5)
    bounded = np.minimum(half * minimum + half * majorant, _LARGEST_SHARE * majorant)
    spread, above = maximum - minimum, maximum - mean
    least_share = np.divide(
        above, spread, out=np.zeros_like(above), where=spread > 0
    )  # of values at the minimum
    growth = np.divide(WEIGHT_GROWTH * mean, least_share, out=np.copy(maximum), where=least_share > 0)
    bounded = np.minimum(bounded, minimum + growth)
    if majorant_scale >= 1:
        constant = over_channels(maximum - minimum <= CONSTANT * minimum, np.logical_and)
        bounded = np.where(constant[..., None], majorant, bounded)
    if longest is not None:
        bounded = np.minimum(bounded, _raised(minimum, LONGEST_GROWTH / 8, longest))
    fitted: np.ndarray = np.minimum(mean, bounded)
    return fitted


def residual(
    minimum: np.ndarray,
    maximum: np.ndarray,
    mean: np.ndarray | None,
    kind: ResidualControl,
    majorant_scale: float = 1.0,
    longest: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Control of residual ratio tracking, float32 (..., channels), and its residual majorant, float32 (...).

    The residual majorant bounds abs(sigma_t - control) of every channel (times `majorant_scale`, rounded
    up).  It is 0 only where the field is: elsewhere look-ups round, and a rate of 0 would lose what they say.

    An estimate's second moment grows as exp ∫ (sigma_t - c)² / sigma_r, where sigma_r is at least half of
    what the cell's extrema span.  Through a gap in thick cells the mean as control would leave zeros and
    nothing else, since what balances them has a probability of exp(-1000).  So where `longest`, float64
    (channels,), gives the optical depth at density 1 of the longest way through the medium, c exceeds the
    minimum by no more than LONGEST_GROWTH allows.
    """
    if kind not in ("mean", "min", "max"):
        raise ValueError(f"no residual control {kind!r}")
    chosen = {"mean": mean, "min": minimum, "max": maximum}[kind]
    if chosen is None:
        raise ValueError("a control at the mean needs means")
    if longest is not None:
        span = over_channels(maximum - minimum, np.maximum)[..., None].astype(np.float64)
        growth = np.sqrt(LONGEST_GROWTH / 2 * span * longest.max())
        chosen = np.minimum(chosen, _raised(minimum, growth, longest))
    exact = chosen.astype(np.float64)
    spread = over_channels(np.maximum(maximum - exact, exact - minimum), np.maximum)
    spread = np.maximum(spread, over_channels(maximum, np.maximum) * np.float64(_LEAST_SPREAD))
    return chosen, _rounded_up(spread * majorant_scale)


def looseness(cells: CellBounds, kind: Control, majorant_scale: float = 1.0) -> np.ndarray:
    """Expected look-ups per optical length, (...): scaled majorant less the channels' mean control.

    The split cost of METHODS §5; never negative.
    """
    majorant = scaled_majorant(cells.maximum, majorant_scale)
    if kind == "none":
        return majorant
    subtracted = control(cells.minimum, cells.maximum, cells.mean, kind, majorant_scale).astype(np.float64)
    mean = over_channels(subtracted, np.add) / subtracted.shape[-1]
    loose: np.ndarray = np.maximum(majorant - mean, 0.0)
    return loose


def _raised(minimum: np.ndarray, depth: np.ndarray | float, longest: np.ndarray) -> np.ndarray:
    """The minimum and as much as makes the optical depth `depth` along the longest way; float32."""
    raised: np.ndarray = minimum + depth / np.maximum(longest, 1e-300)
    return raised.astype(np.float32)


def _rounded_up(values: np.ndarray) -> np.ndarray:
    """The least float32 not below each float64."""
    near = values.astype(np.float32)
    return np.where(near < values, np.nextafter(near, np.float32(np.inf)), near)
