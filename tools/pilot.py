"""How good the choice of `--technique auto:pilot` is: against the best of all that it considered, and more.

Each scene has its pilot; then every combination it measured renders again, by turns, in rounds of others, and
with them some that its search, one family after the other, did not meet.  The best is found in one half of
those rounds and compared with the choice in the other, so that it is not best by luck; intervals are of 95 %,
a bootstrap over pixels and rounds.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click
import numpy as np
from folders import SCENES as FOLDER
from rich.console import Console
from rich.progress import track

from clvol.cli.options import device_option
from clvol.device.device import open_device
from clvol.lab.candidates import Candidate, Relative, error, inverse_efficiency, relative_efficiency
from clvol.lab.combinations import unbiased
from clvol.lab.pilot import CHOSEN, ROUNDS, Found, Pilot
from clvol.lab.pilot import HOPELESS as SLOW
from clvol.lab.quiet import quiet_renders
from clvol.lab.seeds import independent_seeds
from clvol.planning.choices import Choices
from clvol.scene import load_file

if TYPE_CHECKING:
    from collections.abc import Callable

SCENES = {
    "cloud": {"res": 96},
    "smoke": {"width": 72, "height": 96},
    "fire": {"width": 72, "height": 96},
    "room": {"res": 96},
    "clouds": {"width": 100, "height": 64},
}
AGAIN = 4
"""Samples of a round over those of the pilot's."""
HOPELESS = 0.6
"""Combinations that first rounds find no more efficient than so, beside auto's, are not measured again."""
ENOUGH = 0.8
"""Part of the best's efficiency that the interval of the choice's must reach."""
HEADER = (
    "| scene | pilot's choice | best of all measured | choice / best | within 20 % | choice / auto | pilot |",
    "|---|---|---|---|---|---|---|",
)


@dataclass(frozen=True)
class Tested:
    """A pilot and the rounds that judge its choice.

    Parameters
    ----------
    measured : what rendered again, auto's rules first.  added : those of them the search did not meet.
    drawn : how many of these there were before hopeless ones were dropped.
    to_best, to_auto : efficiency of the choice over those of the best and of auto's rules.
    """

    scene: str
    found: Found
    measured: list[Candidate]
    added: list[Candidate]
    drawn: int
    best: Candidate
    to_best: Relative
    to_auto: Relative

    @property
    def within(self) -> bool:
        """Whether the choice may be within 20 % of the best: its ratio's interval includes 0.8 or more."""
        return self.to_best.high >= ENOUGH

    def row(self) -> str:
        """A line of the table."""
        chosen = " + ".join(self.found.names.values())
        where = ", not met by the search" if self.best in self.added else ""
        searched = len(self.measured) - len(self.added)
        best = f"{self.best.label}{where} ({searched} searched, {len(self.added)} of {self.drawn} others)"
        cost = f"{self.found.seconds:.1f} s, kernels {self.found.kernel_seconds:.0f} s"
        verdict = "yes" if self.within else "**NO**"
        return f"| {self.scene} | {chosen} | {best} | {self.to_best} | {verdict} | {self.to_auto} | {cost} |"


def unmet(pilot: Pilot, count: int) -> list[Candidate]:
    """So many combinations that the search did not meet, of all that are possible and compose own kernels.

    They are rendered as often as the search does at first, hopelessly slow ones once.
    """
    product = list(itertools.product(*(unbiased(family) for family in CHOSEN)))
    drawn = (product[place] for place in np.random.default_rng(0).permutation(len(product)))
    asked = (pilot.choices.but(**dict(zip(CHOSEN, names, strict=True))) for names in drawn)
    added = list(itertools.islice(pilot.admitted(asked, list(pilot.candidates)), count))
    auto = pilot.candidates[0]
    limit = SLOW * float(np.median(auto.seconds))
    for candidate in added:
        while len(candidate.images) < ROUNDS and (not candidate.seconds or candidate.seconds[-1] < limit):
            pilot.render(candidate)
    return added


def tested(name: str, spp: int, rounds: int, more: int, device: str | None) -> Tested:
    """A scene's pilot, then rounds of what it considered and of `more` others."""
    scene = load_file(str(FOLDER / f"{name}.xml"), **SCENES[name])
    pilot = Pilot(open_device(device), scene, Choices(), independent_seeds(0, "pilot"), spp, None, None, True)
    with quiet_renders():
        found = pilot.found()
        auto = pilot.candidates[0]
        added = unmet(pilot, more)
        chosen = next(c for c in pilot.candidates if is_of(c, found.names))
        known = [c for c in pilot.candidates if len(c.images) > 1]
        worth = [c for c in known if relative_efficiency(c, auto).value > HOPELESS]
        again = [c for c in pilot.candidates if c in (auto, chosen) or c in worth]
        for candidate in again:
            candidate.images, candidate.seconds = [], []
        seeds = independent_seeds(0, "the test of the pilot")
        for turn in track(range(2 * rounds), name, console=Console(stderr=True)):
            for n in range(len(again)):
                again[(n + turn) % len(again)].render(next(seeds), AGAIN * pilot.spp)
    best, to_best, to_auto = compared(again, chosen)
    return Tested(name, found, again, [c for c in added if c in again], len(added), best, to_best, to_auto)


def compared(again: list[Candidate], chosen: Candidate) -> tuple[Candidate, Relative, Relative]:
    """The best, by one half of the rounds; by the other, the choice's efficiency over its and auto's."""
    first, second = ({id(c): half(c, which) for c in again} for which in (0, 1))
    costs = [inverse_efficiency(error(c, list(first.values())), c.seconds, c.extra) for c in first.values()]
    best = again[costs.index(min(costs))]
    choice = second[id(chosen)]
    return best, *(relative_efficiency(choice, second[id(other)]) for other in (best, again[0]))


def is_of(candidate: Candidate, names: dict[str, str]) -> bool:
    """Whether a candidate is the one with these choices."""
    return all(candidate.trial.session.plan.chosen[family] == name for family, name in names.items())


def half(candidate: Candidate, which: int) -> Candidate:
    """Every second round of a candidate."""
    return Candidate(
        candidate.label,
        candidate.trial,
        candidate.images[which::2],
        candidate.seconds[which::2],
        AGAIN * candidate.extra,
    )


def pilot_options(command: Callable) -> Callable:
    """What a test of the pilot may be asked."""
    for option in (
        device_option,
        click.option("--scene", "scenes", multiple=True, type=click.Choice(list(SCENES)), help="Only these."),
        click.option(
            "--more",
            default=4,
            show_default=True,
            type=click.IntRange(min=0),
            help="Combinations that the search did not meet, to be measured too.",
        ),
        click.option(
            "--rounds", default=4, show_default=True, type=click.IntRange(min=2), help="Of each half."
        ),
        click.option(
            "--spp",
            default=64,
            show_default=True,
            type=click.IntRange(min=1),
            help="Samples of the picture that the pilot is for.",
        ),
    ):
        command = option(command)
    return command


@click.command()
@pilot_options
@click.option("--all", "everything", is_flag=True, help="Print every combination's efficiency over auto's.")
def main(
    spp: int, rounds: int, more: int, scenes: tuple[str, ...], everything: bool, device: str | None
) -> None:
    """Compare the pilot's choice with the best of what it considered, and of others, on five scenes.

    The exit status is 1 where a choice is more than 20 % less efficient than the best: where the 95 %
    interval of their ratio ends below 0.8.

    \b
    python tools/pilot.py                    the table, in about a quarter of an hour
    python tools/pilot.py --scene fire --more 12 --all
    """
    click.echo("\n".join(HEADER))
    within = True
    for name in scenes or SCENES:
        outcome = tested(name, spp, rounds, more, device)
        within &= outcome.within
        click.echo(outcome.row())
        for candidate in outcome.measured if everything else ():
            click.echo(f"    {candidate.label}: {relative_efficiency(candidate, outcome.measured[0])}")
    sys.exit(0 if within else 1)


if __name__ == "__main__":
    main()
