"""Which of several combinations do not make the picture that the others make, from rounds of each.

A choice is tested by the contrast of all combinations that use it with all that don't, so that a bias that
several share is not hidden in what they are compared with; a combination by the contrast with all others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.agreement import Agreement, agreement
from clvol.lab.statistics import round_variance
from clvol.rendering.doubts import LARGE_WEIGHT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.lab.combinations import Names

NOISY = 4.0
"""A combination that has so many times the median variance is not what others are compared with."""

UNSURE = 0.1
"""Nor one that may lack so much of the mean, in rare samples that were not drawn, without an alarm."""


@dataclass(eq=False)
class Tested:
    """One combination and how it fared.

    Parameters
    ----------
    options : what `clvol render` repeats it with.  names : the choices in force, by family.
    images : float32 (rounds, height, width, channels).
    totals : sums over the rounds of what `result.stats` counts.  largest_weight : the largest of the rounds.
    needs_bound : right only where majorants bound the density.
    found : what a light that is found by chance adds to a pixel of a round; 0 where lights are sampled.
    agreement : with all others that agree, or the contrast that accuses it; None where there is no other.
    agrees : no test of it, adjusted for the number of all tests (Holm), is an alarm.
    doubtful : samples not seen, of large weights or of lights found by chance, may be why it does not agree,
        or why a black picture in its place would have been no alarm.
    """

    options: str
    names: Names
    needs_bound: bool
    images: np.ndarray = field(default_factory=lambda: np.empty(0))
    totals: dict[str, int] = field(default_factory=dict)
    largest_weight: float = 1.0
    found: float = 0.0
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
        return float(round_variance(self.images).mean())


@dataclass(frozen=True, eq=False)
class Side:
    """Combinations, and the choices that they and no others use, as "family name"."""

    members: tuple[Tested, ...]
    choices: tuple[str, ...]

    @property
    def heavy(self) -> bool:
        """Whether all of them are."""
        return all(one.heavy for one in self.members)


@dataclass(frozen=True, eq=False)
class Contrast:
    """Combinations that use a choice against those that don't.  users : the smaller side."""

    users: Side
    others: Side
    agreement: Agreement

    @property
    def even(self) -> bool:
        """Whether nobody can say which side is wrong."""
        return len(self.users.members) == len(self.others.members) and self.users.heavy == self.others.heavy

    @property
    def accused(self) -> tuple[Tested, ...]:
        """The side whose weights are large, else the smaller side; of equal ones both."""
        if self.users.heavy != self.others.heavy:
            return (self.users if self.users.heavy else self.others).members
        return self.users.members + self.others.members if self.even else self.users.members

    @property
    def why(self) -> str:
        """The sides and what their comparison found, for a contrast that is an alarm."""
        users, others = (" or ".join(side.choices) for side in (self.users, self.others))
        return (
            f"The {len(self.users.members)} combinations {f'of {users}' if users else f'without {others}'} "
            f"DISAGREE with the {len(self.others.members)} {f'of {others}' if others else 'others'}: "
            f"{self.agreement.explanation}{'; which are wrong cannot be told' if self.even else ''}."
        )


@dataclass(frozen=True, eq=False)
class Judgement:
    """What `judge` found beside what it wrote into each `Tested`.

    Parameters
    ----------
    guilty : contrasts that were alarms.  limits : smallest relative bias of each choice that would have been
        seen, of those that are not doubtful.
    """

    guilty: tuple[Contrast, ...]
    limits: tuple[float, ...]


def judge(tested: list[Tested], alpha: float) -> Judgement:
    """Test each choice and each combination against the others, and strike out the worst until all agree.

    What is wrong so does not accuse those it is compared with.

    Each test is of level alpha over the number of those left (Holm); the first of them all accuse a sound
    combination with probability alpha together.
    """
    left = list(tested)
    struck: list[Tested] = []
    guilty: list[Contrast] = []
    contrasts: list[Contrast] = []
    while len(left) > 1:
        splits = _splits(left)
        level = alpha / (len(left) + len(splits))
        for one in left:
            one.agreement = _against(one, left, level)
        contrasts = [Contrast(a, b, _contrast(a.members, b.members, level)) for a, b in splits]
        worst, found = min(_found([*left, *contrasts]), key=_badness)
        if found.agrees:
            break
        accused: Sequence[Tested]
        if isinstance(worst, Contrast):
            guilty.append(worst)
            accused = worst.accused
            for one in accused:
                one.agreement = found
        else:
            accused = left if len(left) == 2 else [worst]  # of two, nobody can say which
        struck += accused
        left, contrasts = [one for one in left if one not in accused], []
    shared = {one for contrast in guilty for one in contrast.accused}
    for one in struck:
        one.doubtful = one.agrees = one.heavy
        if left and one not in shared:
            one.agreement = _against(one, [one, *left], alpha / len(tested))
    for one in left if any(other.images.any() for other in tested) else ():
        one.doubtful = one.agreement is not None and one.agreement.smallest_bias > 1
    limits = [
        contrast.agreement.smallest_bias
        for contrast in contrasts
        if not any(all(one.doubtful for one in side.members) for side in (contrast.users, contrast.others))
    ]
    return Judgement(tuple(c for c in guilty if not all(one.agrees for one in c.accused)), tuple(limits))


def _found(compared: Sequence[Tested | Contrast]) -> list[tuple[Tested | Contrast, Agreement]]:
    """Those that were compared with others, each with what that found."""
    return [(one, one.agreement) for one in compared if one.agreement is not None]


def _badness(found: tuple[Tested | Contrast, Agreement]) -> tuple[float, float]:
    """Smallest first: the p-value, and the distance of the means where p is 0 of several."""
    return found[1].p, -found[1].deviation


def _splits(left: list[Tested]) -> list[tuple[Side, Side]]:
    """Each division of those left into users of a choice and others, once, the smaller side first.

    Not where that is one combination, which has its own test.
    """
    choices: dict[frozenset[int], list[str]] = {}
    for family, name in dict.fromkeys(item for one in left for item in one.names.items()):
        users = frozenset(n for n, one in enumerate(left) if one.names[family] == name)
        choices.setdefault(users, []).append(f"{family} {name}")
    everyone = frozenset(range(len(left)))
    splits = dict.fromkeys(frozenset({users, everyone - users}) for users in choices)
    found = []
    for split in splits:
        smaller, larger = (
            Side(tuple(left[n] for n in sorted(side)), tuple(choices.get(side, ())))
            for side in sorted(split, key=lambda side: (len(side), min(side, default=0)))
        )
        if len(smaller.members) > 1:
            found.append((smaller, larger))
    return found


def _against(one: Tested, everyone: list[Tested], level: float) -> Agreement:
    """Test one against the others pooled."""
    return _contrast((one,), tuple(other for other in everyone if other is not one), level)


def _contrast(users: tuple[Tested, ...], others: tuple[Tested, ...], level: float) -> Agreement:
    """Test two sides, each pooled but for combinations that are, or may be, much noisier than most.

    These would drown the rest; they count where a side has no other.
    """
    everyone = (*users, *others)
    bound = NOISY * float(np.median([one.noise for one in everyone]))
    light = max(float(one.images.sum(dtype=np.float64)) for one in everyone) / others[0].images.shape[-1]

    def quiet(side: tuple[Tested, ...]) -> list[Tested]:
        calm = [one for one in side if one.noise <= bound]
        calm = [one for one in calm if one.found * math.log(1 / level) <= UNSURE * light] or calm
        return [one for one in calm if not one.heavy] or calm or list(side)

    a, b = quiet(users), quiet(others)
    left, right = (np.concatenate([one.images for one in side]) for side in (a, b))
    largest = (max(one.found for one in a), max(one.found for one in b))
    return agreement(left, right, alpha=level, spp=(1, 1), largest=largest)
