"""How good the choice of `--technique auto:pilot` is: against the best of all that it considered.

Each scene has its pilot; then every combination it measured renders again, by turns, in rounds of others.
The best is found in one half of those rounds and compared with the choice in the other, so that it is not
best by luck; intervals are of 95 %, a bootstrap over pixels and rounds.
"""

from __future__ import annotations

from pathlib import Path

import click
from rich.progress import track

from clvol.choices import Choices
from clvol.device import open_device
from clvol.measure.candidates import Candidate, Relative, error, inverse_efficiency, relative_efficiency
from clvol.measure.combinations import independent_seeds
from clvol.measure.pilot import Found, Pilot
from clvol.measure.quiet import quiet_renders
from clvol.scene import load_file

ROOT = Path(__file__).resolve().parent.parent
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
"""Combinations that the pilot found so much less efficient than auto's rules are not measured again."""


def measured(
    name: str, spp: int, rounds: int, device: str | None
) -> tuple[Found, list[Candidate], Candidate, Relative, Relative]:
    """What the pilot found; its candidates with new rounds; the best; choice over best, choice over auto."""
    scene = load_file(str(ROOT / "scenes" / f"{name}.xml"), **SCENES[name])
    pilot = Pilot(open_device(device), scene, Choices(), independent_seeds(0, "pilot"), spp, None, None, True)
    with quiet_renders():
        found = pilot.found()
        auto = pilot.candidates[0]
        known = [c for c in pilot.candidates if len(c.images) > 1]
        again = [c for c in known if c is auto or relative_efficiency(c, auto).value > HOPELESS]
        for candidate in again:
            candidate.images, candidate.seconds = [], []
        seeds = independent_seeds(0, "the test of the pilot")
        for turn in track(range(2 * rounds), name):
            for n in range(len(again)):
                again[(n + turn) % len(again)].render(next(seeds), AGAIN * pilot.spp)
    halves = {id(c): (half(c, 0), half(c, 1)) for c in again}
    first = [halves[id(c)][0] for c in again]
    costs = [inverse_efficiency(error(c, first), c.seconds, c.extra) for c in first]
    best = again[costs.index(min(costs))]
    names = found.names
    chosen = next(c for c in again if all(getattr(c.trial.session.config, f) == n for f, n in names.items()))
    choice = halves[id(chosen)][1]
    return (
        found,
        again,
        best,
        relative_efficiency(choice, halves[id(best)][1]),
        relative_efficiency(choice, halves[id(auto)][1]),
    )


def half(candidate: Candidate, which: int) -> Candidate:
    """Every second round of a candidate."""
    return Candidate(
        candidate.label,
        candidate.trial,
        candidate.images[which::2],
        candidate.seconds[which::2],
        AGAIN * candidate.extra,
    )


@click.command()
@click.option("--spp", default=64, show_default=True, help="Samples of the picture that the pilot is for.")
@click.option("--rounds", default=4, show_default=True, type=click.IntRange(min=2), help="Of each half.")
@click.option("--scene", "scenes", multiple=True, type=click.Choice(list(SCENES)), help="Only these.")
@click.option("--all", "everything", is_flag=True, help="Print every combination's efficiency over auto's.")
@click.option("--device", metavar="PATTERN", help="Part of the device's name; see clvol devices.")
def main(spp: int, rounds: int, scenes: tuple[str, ...], everything: bool, device: str | None) -> None:
    """Compare the pilot's choice with the best of what it considered, on five scenes.

    \b
    python tools/pilot.py                    the table, in about ten minutes
    python tools/pilot.py --scene fire --all
    """
    click.echo("| scene | pilot's choice | best of those measured | choice / best | choice / auto | pilot |")
    click.echo("|---|---|---|---|---|---|")
    for name in scenes or SCENES:
        found, again, best, to_best, to_auto = measured(name, spp, rounds, device)
        chosen = " + ".join(found.names.values())
        click.echo(
            f"| {name} | {chosen} | {best.label} of {len(again)} | {to_best} | {to_auto} "
            f"| {found.seconds:.1f} s, kernels {found.kernel_seconds:.0f} s |"
        )
        for candidate in again if everything else ():
            click.echo(f"    {candidate.label}: {relative_efficiency(candidate, again[0])}")


if __name__ == "__main__":
    main()
