"""The price of every technique: variance, look-ups and time per sample on three scenes (docs/techniques.md).

Renders take turns, round by round, each round with a seed of its own; the variance is the one between rounds,
the time is CPU time with kernels built before.  Efficiency is 1 / (variance x time).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

import click
import numpy as np
from bench_tables import thread_count
from efficiency import Rounds, efficiencies, image_mean, pixel_variance
from rich.progress import track
from scene_options import OpenScene, open_scene

from clvol.choices import resolve
from clvol.errors import OptionError
from clvol.registry import FAMILIES, TECHNIQUES, TRANSMITTANCES

ROOT = Path(__file__).resolve().parent.parent
SCENES = {
    "grey cloud": ("scenes/cloud.xml", {"res": 96}, "a procedural cumulus, albedo 0.9, under a white sky"),
    "chromatic smoke": (
        "scenes/smoke.xml",
        {"width": 72, "height": 96},
        "smoke whose extinction is 6 : 3 : 1 in red, green and blue, in low sunlight",
    ),
    "fire": (
        "scenes/fire.xml",
        {"width": 72, "height": 96},
        "black smoke over flames: emission, absorption, low sun",
    ),
}
INTRODUCTION = """\
Made by `{command}`, on {threads} threads.
Renders take turns; the variance (mean over pixels and channels, of one sample) is the one between rounds, and
has itself an error of some percent; times are CPU times of the render, the building of kernels and majorants
apart. Efficiency is 1 / (variance × time), as a multiple of what `auto` takes, and varies by a tenth from run
to run. The means of all unbiased rows of a scene agree but for their errors; those of marching need not."""


@dataclass
class Row:
    """One combination on one scene: what it renders with, and what its rounds found."""

    family: str
    name: str
    opened: OpenScene
    spp: int = 0
    images: list[np.ndarray] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    lookups: float = 0.0
    largest_weight: float = 0.0
    largest_sample: float = 0.0

    def render(self, spp: int, seed: int) -> float:
        """Render a round; CPU seconds of the render alone."""
        session = self.opened.session(seed)
        started = time.process_time()
        done = session.run(0, spp, None, None, lambda: False)
        cpu = time.process_time() - started
        result = session.result(0, done)
        self.images.append(result.image)
        self.cpu.append(cpu)
        self.lookups = result.stats["lookups"] / (result.image[..., 0].size * spp)
        self.largest_weight = max(self.largest_weight, result.stats["largest_weight"])
        self.largest_sample = max(self.largest_sample, result.stats["largest_sample"])
        return cpu

    def rounds(self) -> Rounds:
        """What `efficiency` works on."""
        return Rounds(np.stack(self.images), np.array(self.cpu), self.spp)


def measured(scene: str, seconds: float, rounds: int, device: str | None) -> list[Row]:
    """Every technique with the default transmittance, and every transmittance with the default technique."""
    path, sizes, _ = SCENES[scene]
    asked = [("technique", name) for name in TECHNIQUES] + [
        ("transmittance", name) for name in TRANSMITTANCES
    ]
    rows = []
    for family, name in asked:
        try:
            rows.append(Row(family, name, open_scene(str(ROOT / path), sizes, {family: name}, device)))
        except OptionError as error:
            click.echo(f"{scene}: {error}", err=True)
    for row in track(rows, f"{scene}: kernels"):
        trial = max(row.render(4, 0), 1e-3)
        row.spp = max(4, round(4 * seconds / trial))
        row.images, row.cpu = [], []
    for seed in track(range(1, rounds + 1), f"{scene}: rounds"):
        for row in rows:
            row.render(row.spp, seed)
    return rows


def table(rows: list[Row]) -> list[str]:
    """Markdown rows; efficiency relative to what `auto` takes."""
    auto = resolve(rows[0].opened.prepared.features, dict.fromkeys(FAMILIES, "auto"))
    base = {row.family: row for row in rows if row.name == auto[row.family]}
    lines = [
        "| per sample: | variance | look-ups | CPU µs | efficiency | largest weight | mean of the image |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        rounds = row.rounds()
        mean, error = image_mean(rounds)
        relative = np.median(efficiencies(rounds) / efficiencies(base[row.family].rounds()))
        mark = " (auto)" if row is base[row.family] else ""
        biased = " *biased*" if FAMILIES[row.family][row.name].biased else ""
        lines.append(
            f"| {row.family} `{row.name}`{mark}{biased} | {pixel_variance(rounds).mean():.4g} "
            f"| {row.lookups:.3g} | {1e6 * np.median(rounds.cpu) / rounds.paths:.3g} "
            f"| {relative:.2f} | {row.largest_weight:.3g} "
            f"| {mean:.5f} ± {error:.5f} |"
        )
    return lines


@click.command()
@click.option("--seconds", default=1.5, show_default=True, help="CPU seconds of one render, about.")
@click.option("--rounds", default=6, show_default=True, type=click.IntRange(min=2))
@click.option("--scene", "scenes", multiple=True, type=click.Choice(list(SCENES)), help="Only these.")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Write the tables there, as Markdown.")
@click.option("--device", metavar="PATTERN", help="Part of the device's name; see clvol devices.")
def main(
    seconds: float, rounds: int, scenes: tuple[str, ...], output: Path | None, device: str | None
) -> None:
    """Measure every technique and transmittance on three scenes.

    \b
    python tools/techniques.py -o docs/techniques.md     regenerates the table of the documentation
    """
    command = f"python tools/techniques.py --seconds {seconds:g} --rounds {rounds} -o docs/techniques.md"
    parts = ["# What each technique costs", "", INTRODUCTION.format(command=command, threads=thread_count())]
    for scene in scenes or SCENES:
        rows = measured(scene, seconds, rounds, device)
        parts += ["", f"## {scene.capitalize()}", "", f"`{SCENES[scene][0]}`: {SCENES[scene][2]}.", ""]
        parts += table(rows)
    text = "\n".join(parts) + "\n"
    if output:
        output.write_text(text, encoding="utf-8")
    else:
        click.echo(text)


if __name__ == "__main__":
    main()
