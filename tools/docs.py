"""Regenerates what the documentation shows: pictures, the view of a ray, tables of what techniques cost.

Pictures and the ray are made by the very commands that README prints; tables by `clvol.compare`.
"""

from __future__ import annotations

import math
import platform
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
from bench_tables import thread_count

import clvol
from clvol.comparison.figures import Comparison, Figures
from clvol.registry import TECHNIQUES, TRANSMITTANCES

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
SMALL = {"width": 48, "height": 64}
SCENES = {
    "Grey cloud": ("scenes/cloud.xml", {"res": 64}, "a procedural cumulus, albedo 0.9, under a white sky"),
    "Chromatic smoke": (
        "scenes/smoke.xml",
        SMALL,
        "smoke whose extinction is 6 : 3 : 1 in red, green and blue, in low sunlight",
    ),
    "Fire": ("scenes/fire.xml", SMALL, "black smoke over flames: emission, absorption, low sun"),
}
SAMPLED = {
    "cloud": {"res": 64},
    "smoke": SMALL,
    "fire": SMALL,
    "room": {"res": 64},
    "shaft": {"width": 64, "height": 40},
}
INTRODUCTION = """\
# What techniques and samplers cost

Made by `python tools/docs.py techniques --seconds {seconds:g} --rounds {rounds}` with
`clvol.compare`: {threads} threads, {machine}. Combinations render by turns, {seconds:g} seconds
each in {rounds} rounds, with independent samples; errors are those against a reference of
independent seeds, whose own variance is subtracted. Efficiency is 1 / (MSE × seconds),
precomputation counted and kernel builds not, and 1 / (MSE × look-ups), as multiples of the first
row's, with 95 % intervals; **bold** where the difference is significant (Holm). The slope is that
of a render's MSE over its samples: -1 for independent samples without bias (no slope where renders
are too short to be cut). "Bias seen" is the
smallest relative bias of the image mean that the test against the reference would have noticed; its
verdict has a false alarm once in 10,000.
"""
SAMPLERS = """\
## Samplers

At 64 samples a pixel, beside `delta` with sampler `independent`; {rounds} renders of each by turns.

| scene, technique, sampler | MSE, times less | efficiency by time | largest pixel error, times less |
|---|---|---|---|
"""


def commands() -> dict[str, list[str]]:
    """README's commands that make pictures of docs/, by the picture's name."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = {}
    for line in re.findall(r"clvol (?:render|ray) scenes/[^`\n]+", text):
        words = shlex.split(line)
        for output in (words[n + 1] for n, word in enumerate(words[:-1]) if word == "-o"):
            name = Path(output).stem
            if (DOCS / f"{name}.png").exists():
                found[name] = words
    return found


def run(words: list[str], name: str) -> None:
    """One of README's commands, with docs/NAME.png as its output."""
    kept, rest = [], iter(words[1:])
    for word in rest:
        if word == "-o":
            next(rest)
        else:
            kept.append(word)
    subprocess.run([sys.executable, "-m", "clvol.cli", *kept, "-o", f"docs/{name}.png"], cwd=ROOT, check=True)


def compared(scene: str, sizes: dict[str, int], **options: object) -> Comparison:
    """A comparison on one of our scenes, with a progress bar."""
    return clvol.compare(clvol.load_file(str(ROOT / scene), **sizes), progress=True, **options)


def table(comparison: Comparison) -> list[str]:
    """Rows of a comparison as Markdown."""
    lines = [
        "| | efficiency by time | by look-ups | look-ups a sample | slope | bias seen | agrees |",
        "|---|---|---|---|---|---|---|",
    ]
    return lines + [row(figures) for figures in comparison.figures]


def row(figures: Figures) -> str:
    """One combination."""
    measured = figures.measured
    pixels = measured.images[0][..., 0].size
    lookups = measured.lookups.mean() / (pixels * measured.spp)
    slope, verdict = figures.render_slope, figures.verdict
    efficiency = [shown(figures, cost) for cost in ("seconds", "lookups")]
    name = f"`{figures.label}`" + (" *biased*" if figures.biased else "")
    return (
        f"| {name} | {efficiency[0]} | {efficiency[1]} | {lookups:.3g} "
        f"| {'–' if math.isnan(slope.value) else f'{slope.value:.2f} ({slope.low:.2f} to {slope.high:.2f})'} "
        f"| {100 * verdict.smallest_bias:.2g} % | {'yes' if verdict.agrees else 'NO'} |"
    )


def shown(figures: Figures, cost: str) -> str:
    """An efficiency relative to the first row's."""
    if cost not in figures.efficiency:
        return "–"
    efficiency = figures.efficiency[cost]
    ratio = efficiency.ratio
    text = f"{ratio.value:.2f}" if ratio.value < 10 else f"{ratio.value:.0f}"
    if ratio.low == ratio.high:
        return text
    return f"{f'**{text}**' if efficiency.significant else text} ({ratio.low:.2f} to {ratio.high:.2f})"


def sampler_rows(name: str, rounds: int) -> list[str]:
    """What low-discrepancy samples gain on a scene, and with which technique."""
    comparison = compared(
        f"scenes/{name}.xml",
        SAMPLED[name],
        techniques=["delta", "regular"],
        samplers=["independent", "sobol"],
        spp=64,
        rounds=rounds,
    )
    first = comparison.figures[0]
    rows = []
    for figures in comparison.figures:
        gain = first.mse.value[0] / figures.mse.value[0]
        largest = abs(first.largest_error.difference / figures.largest_error.difference)
        rows.append(f"| {name}, {figures.label} | {gain:.2f} | {shown(figures, 'seconds')} | {largest:.2f} |")
    return rows


@click.group()
def main() -> None:
    """Regenerate parts of docs/."""


@main.command()
@click.argument("names", nargs=-1)
def pictures(names: tuple[str, ...]) -> None:
    """The pictures that README shows, or only those NAMES, by the commands that stand beside them."""
    for name, words in commands().items():
        if not names or name in names:
            click.echo(shlex.join(words))
            run(words, name)


@main.command()
@click.option("--seconds", default=10.0, show_default=True, help="Of each combination.")
@click.option("--rounds", default=10, show_default=True, type=click.IntRange(min=4))
@click.option("--output", default=str(DOCS / "techniques.md"), type=click.Path(path_type=Path))
def techniques(seconds: float, rounds: int, output: Path) -> None:
    """The tables of techniques.md: every technique and transmittance, on three scenes; the samplers."""
    about = {"threads": thread_count(), "machine": platform.machine()}
    parts = [INTRODUCTION.format(seconds=seconds, rounds=rounds, **about)]
    options = {"time_limit": seconds, "rounds": rounds, "sampler": "independent"}
    for title, (scene, sizes, what) in SCENES.items():
        parts += [f"## {title}", "", f"`{scene}`: {what}.", ""]
        parts += [*table(compared(scene, sizes, techniques=list(TECHNIQUES), **options)), ""]
        parts += [*table(compared(scene, sizes, transmittances=list(TRANSMITTANCES), **options)), ""]
    parts += [SAMPLERS.format(rounds=rounds).rstrip()]
    for name in SAMPLED:
        parts += sampler_rows(name, rounds)
    output.write_text("\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
