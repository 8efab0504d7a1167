"""What `clvol.selftest` returns: what was found, in figures and in plain words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from clvol.lab.combinations import LIGHTS
from clvol.lab.judgement import Judgement, Tested


@dataclass(eq=False)
class SelfTest:
    """What a self-test found; `passed` and `verdict` say it in short.

    Attributes
    ----------
    tested
        The combinations of choices, each with its rounds and what its comparison with the others found.
    alpha
        Probability that any of a sound scene's combinations is accused.
    size
        Width and height of the film in pixels.
    spp, rounds
        Samples per pixel of a round, and rounds of each combination.
    pairs, all_pairs
        Pairs of choices that occur together in a combination, and those that could.
    left_out
        Biased choices, which are not tested.
    seconds, kernel_seconds
        Of rendering, and of building kernels.
    interrupted_of
        Rounds that there were to be, where Ctrl-C ended them early; else 0.
    judgement
        Of the choices: those that use one against those that do not.
    """

    tested: list[Tested]
    alpha: float
    size: tuple[int, int]
    spp: int
    rounds: int
    pairs: int
    all_pairs: int
    left_out: list[str]
    seconds: float
    kernel_seconds: float = 0.0
    interrupted_of: int = 0
    judgement: Judgement = field(default_factory=lambda: Judgement((), ()))

    @property
    def disagreeing(self) -> list[Tested]:
        """The combinations that do not make the picture that the others make."""
        return [one for one in self.tested if not one.agrees]

    @property
    def faulty(self) -> list[Tested]:
        """The combinations with samples or walks that no sound render has."""
        return [one for one in self.tested if one.faults]

    @property
    def passed(self) -> bool:
        """Nothing disagrees and nothing is faulty."""
        return not self.disagreeing and not self.faulty

    @property
    def biases(self) -> np.ndarray:
        """Relative bias of each combination's and each choice's image mean that would have been seen.

        Without doubtful ones; empty where there was nothing to compare.
        """
        own = [t.agreement.smallest_bias for t in self.tested if t.agreement and not t.doubtful]
        return np.array([*own, *self.judgement.limits])

    @property
    def smallest_bias(self) -> float:
        """Relative bias that would have been seen in any of them; nan where there was nothing to compare."""
        return float(self.biases.max()) if self.biases.size else math.nan

    @property
    def verdict(self) -> str:
        """What was found, in plain words."""
        parts = [contrast.why for contrast in self.judgement.guilty]
        shared = [t for contrast in self.judgement.guilty for t in contrast.accused]
        single = [t for t in self.disagreeing if t not in shared]
        parts += [f"{t.called} DISAGREES with the others: {t.why}." for t in single]
        parts += [f"{t.called} is FAULTY: {', '.join(t.faults)}." for t in self.faulty]
        if not parts:
            parts.append(self._praise())
        parts += [f"Undecided: {t.called}; {t.why}, but {_doubt(t)}." for t in self.tested if t.doubtful]
        return " ".join(parts)

    def _praise(self) -> str:
        if not any(t.images.any() for t in self.tested):
            return f"The picture is black, in {len(self.tested)} of {len(self.tested)} combinations."
        if len(self.tested) == 1:
            return "There is only one way to render this scene, so nothing to compare; its samples are sound."
        if not self.biases.size:
            return "All combinations are too noisy to compare."
        count = sum(not t.doubtful for t in self.tested)
        words = (
            f"All {count} combinations agree."
            if count == len(self.tested)
            else f"{count} combinations agree."
        )
        seen = f"{words} A bias of {100 * self.smallest_bias:.2g} % of any choice's mean would have been seen"
        middle = float(np.median(self.biases))
        if self.smallest_bias > 2 * middle:
            return f"{seen}, and of {100 * middle:.2g} % of most."
        return f"{seen}."


def _doubt(one: Tested) -> str:
    """Why a combination is undecided."""
    if one.heavy:
        return f"weights grew to {one.largest_weight:.2g}, and samples it has not seen may be the reason"
    rare = " and finds lights by chance alone" if one.names.get(LIGHTS) == "found" else ""
    return f"it is so noisy{rare} that a black picture would have been no alarm"
