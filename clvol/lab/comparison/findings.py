"""All that a comparison found: what words, plots and the report are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clvol.lab.comparison.figures import Figures
    from clvol.lab.comparison.reference import Reference


@dataclass(frozen=True, eq=False)
class Findings:
    """Combinations compared on one scene; ``found["delta"]`` are the figures of the one with that label.

    Attributes
    ----------
    figures
        Of each combination, in the order asked for.
    baseline
        Label of the one that efficiencies are relative to.
    reference
        The picture that all are compared with, and how it was made.
    left_out
        Pairs of what was asked for, and why it cannot be.
    doubles
        Pairs of what was asked for, and the label of the combination that it comes to.
    interrupted
        Whether Ctrl-C ended it early.
    about
        How it was made.
    files
        What the scene was read from, which the report does not replace.
    """

    figures: tuple[Figures, ...]
    baseline: str
    reference: Reference
    left_out: tuple[tuple[str, str], ...] = ()
    doubles: tuple[tuple[str, str], ...] = ()
    interrupted: bool = False
    about: dict[str, Any] = field(default_factory=dict)
    files: tuple[str, ...] = ()

    def __getitem__(self, label: str) -> Figures:
        """The figures of one combination."""
        return {f.label: f for f in self.figures}[label]
