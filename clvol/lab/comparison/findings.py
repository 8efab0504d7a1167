"""All that a comparison found: what words, plots and the report are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from clvol.lab.comparison.figures import Figures
from clvol.lab.comparison.reference import Reference


@dataclass(frozen=True, eq=False)
class Findings:
    """Combinations compared on one scene.

    Parameters
    ----------
    figures : of each combination, in the order asked for.
    baseline : label of the one that efficiencies are relative to.
    left_out : (asked for, why it cannot be); doubles : (asked for, label that it comes to).
    interrupted : whether Ctrl-C ended it early.
    about : how it was made.
    """

    figures: tuple[Figures, ...]
    baseline: str
    reference: Reference
    left_out: tuple[tuple[str, str], ...] = ()
    doubles: tuple[tuple[str, str], ...] = ()
    interrupted: bool = False
    about: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, label: str) -> Figures:
        """The figures of one combination."""
        return {f.label: f for f in self.figures}[label]
