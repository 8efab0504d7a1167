"""Which of several combinations do not make the picture that the others make, from rounds of each."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from clvol.measure.agreement import Agreement, agreement
from clvol.measure.combinations import Names
from clvol.registry import FAMILIES
from clvol.session import LARGE_WEIGHT

NOISY = 4.0
"""A combination that has so many times the median variance is not what others are compared with."""


@dataclass(eq=False)
class Tested:
    """One combination and how it fared.

    Parameters
    ----------
    options : what `clvol render` repeats it with.  names : the choices in force, by family.
    images : float32 (rounds, height, width, channels).
    totals : sums over the rounds of what `result.stats` counts.  largest_weight : the largest of the rounds.
    needs_bound : right only where majorants bound the density.
    agreement : with all others that agree; None where there is no other.
    agrees : its p-value, adjusted for the number of combinations (Holm), is no alarm.
    doubtful : it does not agree, but its weights grew so large that samples not seen may be the reason.
    """

    options: str
    names: Names
    needs_bound: bool
    images: np.ndarray = field(default_factory=lambda: np.empty(0))
    totals: dict[str, int] = field(default_factory=dict)
    largest_weight: float = 1.0
    agreement: Agreement | None = None
    agrees: bool = True
    doubtful: bool = False

    @property
    def called(self) -> str:
        """Its options, in a sentence."""
        return self.options or "the only way to render this scene"

    @property
    def why(self) -> str:
        """What its comparison found."""
        return self.agreement.explanation if self.agreement else "there is nothing to compare it with"

    @property
    def faults(self) -> list[str]:
        """What no sound render has, whatever the others show."""
        counted = {"non_finite": "samples not finite", "walks_exhausted": "walks given up"}
        if self.needs_bound:
            counted["majorant_violations"] = "look-ups above their majorant"
        return [f"{self.totals[name]} {what}" for name, what in counted.items() if self.totals.get(name)]

    @property
    def heavy(self) -> bool:
        """Whether its weights grew so large that it is noisier than its rounds show."""
        return self.largest_weight > LARGE_WEIGHT

    @property
    def noise(self) -> float:
        """Variance of a round, the mean over pixels and channels."""
        return float(self.images.var(axis=0, ddof=1, dtype=np.float64).mean())


def judge(tested: list[Tested], alpha: float) -> None:
    """Test each combination against the pooled others, and strike out the worst until all that are left
    agree, so that one that is wrong does not accuse those it is compared with.

    Each test is of level alpha over the number of those left (Holm); the first of them all accuse a sound
    combination with probability alpha together.
    """
    left, struck = list(tested), []
    while len(left) > 1:
        for one in left:
            one.agreement = _against(one, left, alpha / len(left))
        worst = min(left, key=_badness)
        if worst.agreement.agrees:
            break
        accused = left if len(left) == 2 else [worst]  # of two, nobody can say which
        struck += accused
        left = [one for one in left if one not in accused]
    for one in struck:
        one.doubtful = one.heavy
        one.agrees = one.doubtful
        if left:
            one.agreement = _against(one, [one, *left], alpha / len(tested))


def _badness(one: Tested) -> tuple[float, float]:
    """Smallest first: the p-value, and the distance of the means where p is 0 of several."""
    return one.agreement.p, -one.agreement.deviation


def _against(one: Tested, everyone: list[Tested], level: float) -> Agreement:
    """Test one against the others pooled, but for those much noisier than most, which would drown them."""
    bound = NOISY * float(np.median([other.noise for other in everyone]))
    others = [other for other in everyone if other is not one]
    quiet = [other for other in others if other.noise <= bound] or others
    pool = np.concatenate([other.images for other in quiet])
    return agreement(one.images, pool, alpha=level, spp=(1, 1))


def common_choice(tested: list[Tested]) -> str:
    """The choice that best tells those that disagree from those that don't; empty where none does."""
    guilty = [one for one in tested if not one.agrees]
    best, likeness = "", 0.5
    for family, name in dict.fromkeys(item for one in guilty for item in one.names.items()):
        users = [one for one in tested if one.names[family] == name]
        shared = [one for one in users if not one.agrees]
        share = len(shared) / (len(users) + len(guilty) - len(shared))
        if name in FAMILIES.get(family, ()) and share > likeness and len(users) < len(tested):
            likeness = share
            best = f"Of the {len(users)} that use {family} {name}, {len(shared)} of {len(guilty)} disagree."
    return best
