"""Combinations of choices, each opened once and rendered again and again.

Comparisons, self-tests and pilots measure with them.

Rounds of different seeds are independent.  Seconds are those of the render alone; what came before it, once,
is kept apart: precomputation (volumes, majorants, trees), which counts, and kernel builds, which do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from clvol.planning.registry import FAMILIES, option
from clvol.rendering.outcome import make_result
from clvol.rendering.session import Session

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from clvol.device.device import Device
    from clvol.picture.result import Result
    from clvol.planning.choices import Choices
    from clvol.scene.records import Scene


@dataclass(eq=False)
class Trial:
    """One combination, ready to render.

    Parameters
    ----------
    choices : what was asked for, "auto" included.
    names : str by family: what it came to, "none" where the scene has no use for a family.
    precompute_seconds : from the scene's records to buffers on the device, without building kernels.
    """

    session: Session
    choices: Choices
    names: dict[str, str]
    precompute_seconds: float

    @classmethod
    def open(cls, device: Device, scene: Scene, choices: Choices) -> Trial:
        """Build and upload; OptionError for a combination that cannot be right."""
        session = Session.for_scene(device, scene, choices, 0)
        precompute = session.setup_seconds - session.kernel_seconds
        return cls(session, choices, dict(session.plan.in_force), precompute)

    @property
    def biased(self) -> bool:
        """Whether what it came to is labelled as biased."""
        return bool(self.session.plan.biased)

    @property
    def options(self) -> str:
        """The options of `clvol render` that repeat it, without those it has no use for."""
        chosen = self.session.plan.chosen
        used = {
            family: name
            for family, name in self.names.items()
            if name in FAMILIES[family] and name == chosen[family]
        }
        return " ".join(f"{option(family)} {name}" for family, name in used.items())

    def render(self, seed: int, spp: int) -> Result:
        """Samples 0 to spp of every pixel; ``stats["seconds"]["render"]`` is what they took."""
        self.session.restart(seed)
        done = self.session.run(0, spp)
        return make_result(self.session, 0, done)


class Renders(Protocol):
    """What can take part in rounds."""

    def render(self, seed: int, spp: int) -> Result:
        """Samples 0 to spp of every pixel."""


def rounds(trials: Sequence[Renders], spp: Sequence[int], seeds: Iterator[int]) -> Iterator[list[Result]]:
    """Rounds in which every trial renders once, each with a seed of its own.

    The order turns from round to round, so that no trial always begins.
    """
    turn = 0
    while True:
        results: dict[int, Result] = {}
        for n in range(len(trials)):
            place = (n + turn) % len(trials)
            results[place] = trials[place].render(next(seeds), spp[place])
        yield [results[place] for place in range(len(trials))]
        turn += 1
