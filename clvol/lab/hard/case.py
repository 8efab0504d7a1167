"""What a hard case is: a scene, the number that its picture must show, and how a render is held to it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtr

from clvol.errors import OptionError
from clvol.lab.combinations import Names, names_in_force, unbiased
from clvol.lab.trials import Trial
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.planning.registry import FAMILIES
from clvol.scene.loader import load_dict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from clvol.device.device import Device
    from clvol.picture.result import Result
    from clvol.scene.records import Scene

ROUNDING = 1e-5
"""Relative error of float32 arithmetic that is none of the estimator's; cases with more say why."""
NOISY = 0.25
"""Relative standard error from which on a mean shows nothing."""
NORMAL = 1e9
"""Degrees of freedom of an error that is known."""
CROSSED = ("technique", "transmittance", "majorant")
"""Families whose whole product a case is rendered in."""
SAMPLER = {"global": "independent", "grid": "joint", "kdtree": "sobol"}
"""Goes with the majorant, so that each technique and transmittance meets every sampler at no more kernels."""


@dataclass(frozen=True)
class Case:
    """One hard case.

    Parameters
    ----------
    name : short, of words.  group : one of `GROUPS`.
    scene : makes the dict that `load_dict` takes, or the scene.
    expected : makes the mean of the picture, one number or one of each channel.
    source : where that number comes from.
    spp : samples a pixel of each render.
    majorant_scale : multiplies the bounds.
    rounding : relative error of float32 in this case.
    long : it takes up to a minute, and is no quick one.
    brightest : what one sample may show, where samples are so rare that none may have been drawn.
    note : what other renderers are known to do, or what limits this case.
    """

    name: str
    group: str
    scene: Callable[[], dict[str, Any] | Scene]
    expected: Callable[[], np.ndarray]
    source: str
    spp: int = 1024
    majorant_scale: float = 1.0
    rounding: float = ROUNDING
    long: bool = False
    brightest: float = 1.0
    note: str = ""


@dataclass(frozen=True)
class Seen:
    """What one render of a case showed; arrays of channels.

    p : probability of so large a deviation, or larger, by chance; over channels, adjusted for their number.
    faults : what no sound render has.  names : the choices in force.
    """

    case: Case
    names: Names
    mean: np.ndarray
    error: np.ndarray
    expected: np.ndarray
    p: float
    faults: tuple[str, ...]
    largest_weight: float

    @property
    def noise(self) -> float:
        """Relative standard error of the noisiest channel; inf where nothing was seen of what is there."""
        known = self.expected != 0
        noise = self.error[known] / np.abs(self.expected[known])
        noise[self.mean[known] == 0] = np.inf
        return float(noise.max(initial=0.0))

    @property
    def noisy(self) -> bool:
        """Too noisy to show anything."""
        return self.noise > NOISY

    def word(self, alpha: float) -> str:
        """The verdict."""
        if self.faults or self.p < alpha:
            return "WRONG"
        return "too noisy" if self.noisy else "right"


def ways(scene: Scene, majorant_scale: float = 1.0) -> Iterator[Choices]:
    """The product of `CROSSED` as far as the scene tells its members apart."""
    base = Choices(majorant_scale=majorant_scale)
    try:
        plan = Plan.of(scene, base)
    except OptionError:  # what auto takes needs bounds
        plan = Plan.of(scene, base.but(technique="weighted-delta", transmittance="ratio"))
    seen = set()
    for names in itertools.product(*(unbiased(family) for family in CROSSED)):
        asked = base.but(**dict(zip(CROSSED, names, strict=True)), sampler=SAMPLER[names[-1]])
        try:
            used = names_in_force(plan.having(asked))
        except OptionError:
            continue
        what = tuple(used[family] for family in CROSSED)
        if what not in seen:
            seen.add(what)
            yield asked


def check(device: Device, case: Case, scene: Scene, choices: Choices, seed: int) -> Seen:
    """Render a case in one way, and hold it to what is expected."""
    trial = Trial.open(device, scene, choices)
    result = trial.render(seed, case.spp)
    return judged(case, result, trial.names, trial.session.plan.needs_bound, scene.integrator.max_depth < 0)


def judged(case: Case, result: Result, names: Names, needs_bound: bool, whole: bool) -> Seen:
    """Hold a picture, whose pixels all have the same expectation on the mean, to a case.

    `whole`: no limit of depth is part of the scene, so that no energy may be lost to one.
    """
    variance = result.variance.astype(float)
    mean = result.image.mean((0, 1), dtype=float)
    pixels = variance.shape[0] * variance.shape[1]
    error = np.sqrt(variance.sum((0, 1))) / pixels
    expected = np.broadcast_to(np.atleast_1d(case.expected()), mean.shape).astype(float)
    few = FAMILIES["sampler"][names["sampler"]].low_discrepancy
    missed = max(case.brightest, result.stats["largest_sample"]) / (pixels * case.spp)
    p = min(
        p_value(
            float(mean[c] - expected[c]),
            math.hypot(error[c], case.rounding * abs(expected[c])),
            3 * _freedom(variance[..., c]) if few else NORMAL,
            missed,
        )
        for c in range(len(mean))
    )
    return Seen(
        case,
        names,
        mean,
        error,
        expected,
        min(1.0, p * len(mean)),
        faults(result.stats, needs_bound and case.majorant_scale >= 1, whole),
        result.stats["largest_weight"],
    )


def faults(stats: Mapping[str, Any], bounded: bool, whole: bool) -> tuple[str, ...]:
    """What no sound render has: samples that are not finite, walks given up, look-ups above a bound.

    And, of `whole` pictures, energy that is lost.
    """
    names = ("non_finite", "walks_exhausted", *(("majorant_violations",) if bounded else ()))
    names += ("energy_lost_to_caps",) if whole else ()
    return tuple(f"{stats[name]} {name.replace('_', ' ')}" for name in names if stats[name])


def _freedom(variance: np.ndarray) -> float:
    """Pixels that the error of the mean hangs on (Satterthwaite)."""
    squares = float(np.square(variance).sum())
    return float(variance.sum()) ** 2 / squares if squares else float(variance.size)


def p_value(difference: float, error: float, freedom: float, missed: float) -> float:
    """Two-sided, of a mean's difference from what is expected.

    `freedom`: degrees of freedom of the error.  `missed`: what one of the brightest samples adds to the mean.
    One that is too dark may have missed n of them, which has a probability of e^-n.
    """
    if not math.isfinite(difference):
        return 0.0
    if error == 0:
        return 1.0 if difference == 0 else 0.0
    p = 2 * float(stdtr(freedom, -abs(difference) / error))
    return max(p, math.exp(difference / missed)) if difference < 0 else p


def loaded(case: Case) -> Scene:
    """Its scene."""
    made = case.scene()
    return load_dict(made) if isinstance(made, dict) else made
