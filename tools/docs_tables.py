"""The pages and tables that tools/docs.py writes, as Markdown."""

from __future__ import annotations

import math
import platform
import re
from pathlib import Path
from typing import TYPE_CHECKING

import bench
import click
from benchmarks.scene_tables import details
from benchmarks.tables import Figures as Measured
from benchmarks.tables import markdown, thread_count
from folders import ROOT
from pilot import HEADER, HOPELESS, Tested

import clvol
from clvol.device.device import open_device
from clvol.layout.stages import IDLE, QUEUES, STAGES
from clvol.planning.registry import SAMPLERS, TECHNIQUES, TRANSMITTANCES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from clvol.lab.comparison.figures import Figures
    from clvol.lab.comparison.result import Comparison

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
`clvol.compare`: {machine}. Combinations render by turns, {seconds:g} seconds
each in {rounds} rounds, with independent samples; errors are those against a reference of
independent seeds, whose own variance is subtracted. Efficiency is 1 / (MSE × seconds),
precomputation counted and kernel builds not, and 1 / (MSE × look-ups), as multiples of the first
row's, with 95 % intervals; they hold for renders of as many samples a pixel (spp) as stand beside them.
**Bold** where the difference is significant (Holm). The slope is that
of a render's MSE over its samples: -1 for independent samples without bias (no slope where renders
are too short to be cut). "Bias seen" is the
smallest relative bias of the image mean that the test against the reference would have noticed; its
verdict has a false alarm once in 10,000.
"""
SAMPLERS_PART = """\
## Samplers

At 64 samples a pixel, beside `delta` with sampler `independent`; {rounds} renders of each by turns.
`joint` is the default.

| scene, technique, sampler | MSE, times less | efficiency by time | largest pixel error, times less |
|---|---|---|---|
"""


PILOT = """\
# How good the pilot's choice is

Made by `{command}`: {machine}.

`--technique auto:pilot` chose on each scene, for a picture of {spp} samples a pixel. Then all that its
search had measured rendered again by turns, in {rounds} + {rounds} rounds of other seeds, and with it up to
{more} combinations of technique, transmittance and majorant that the search, one family after the other,
did not meet, drawn at random from all that are possible. What first rounds found {hopeless:g} times as
efficient as auto's rules or less, or hopelessly slow, was left out. Efficiency is
1 / (variance × seconds), precomputation counted in proportion to the picture and kernel builds not.

- **pilot's choice**: technique, transmittance and majorant; auto's own rules unless something was better
  beyond doubt.
- **best of all measured**: the most efficient in one half of the rounds; in brackets how many of the
  search's combinations, and how many of the others drawn, were measured to the end.
- **choice / best**, **choice / auto**: the choice's efficiency over that of the best, and of auto's rules,
  in the other half of the rounds, which did not choose the best; with 95 % intervals (a bootstrap over
  pixels and rounds).
- **within 20 %**: whether the interval of choice / best includes 0.8 or more.
- **pilot**: seconds that it rendered for, and those of building kernels, which caches shorten.

"""


def machine() -> str:
    """On what everything is measured."""
    [opened] = open_device(None).context.devices
    driver = f"{opened.platform.name} {opened.driver_version}"
    return f"{thread_count()} threads of {processor()}, {driver}, clvol {clvol.__version__}"


def processor() -> str:
    """The processor's name."""
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found[1].strip() if found else platform.processor() or platform.machine()


def compared(scene: str, sizes: dict[str, int], **options: object) -> Comparison:
    """A comparison on one of our scenes, with a progress bar."""
    return clvol.compare(clvol.load_file(str(ROOT / scene), **sizes), progress=True, **options)


def table(comparison: Comparison) -> list[str]:
    """Rows of a comparison as Markdown."""
    lines = [
        "| | spp | efficiency by time | by look-ups | look-ups a sample | slope | bias seen | agrees |",
        "|---|---|---|---|---|---|---|---|",
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
        f"| {name} | {measured.spp} | {efficiency[0]} | {efficiency[1]} | {lookups:.3g} "
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
        samplers=list(SAMPLERS),
        spp=64,
        rounds=rounds,
        reference_spp=16 * 64,
    )
    first = comparison.figures[0]
    rows = []
    for figures in comparison.figures:
        gain = first.mse.value[0] / figures.mse.value[0]
        largest = abs(first.largest_error.difference / figures.largest_error.difference)
        rows.append(f"| {name}, {figures.label} | {gain:.2f} | {shown(figures, 'seconds')} | {largest:.2f} |")
    return rows


def techniques_page(seconds: float, rounds: int) -> str:
    """The text of techniques.md."""
    parts = [INTRODUCTION.format(seconds=seconds, rounds=rounds, machine=machine())]
    options = {"time_limit": seconds, "rounds": rounds, "sampler": "independent"}
    for title, (scene, sizes, what) in SCENES.items():
        parts += [f"## {title}", "", f"`{scene}`: {what}.", ""]
        parts += [*table(compared(scene, sizes, techniques=list(TECHNIQUES), **options)), ""]
        parts += [*table(compared(scene, sizes, transmittances=list(TRANSMITTANCES), **options)), ""]
    parts += [SAMPLERS_PART.format(rounds=rounds).rstrip()]
    for name in SAMPLED:
        parts += sampler_rows(name, rounds)
    return "\n".join(parts) + "\n"


def pilot_page(command: str, outcomes: Iterable[Tested], **about: object) -> tuple[str, bool]:
    """The text of pilot.md, and whether every choice is within 20 % of the best."""
    lines, within = list(HEADER), True
    for outcome in outcomes:
        lines.append(outcome.row())
        click.echo(lines[-1])
        within &= outcome.within
    text = PILOT.format(command=command, machine=machine(), hopeless=HOPELESS, **about)
    return text + "\n".join(lines) + "\n", within


def transitions_part() -> str:
    """The contracts of the stages as a table: where each hands a path on to, and why."""
    lines = ["| stage | empties | hands a path on to | when |", "|---|---|---|---|"]
    for stage in STAGES:
        for n, transition in enumerate(stage.transitions):
            first = f"**{stage.name}** | {stage.empties}" if n == 0 else " | "
            lines.append(f"| {first} | {transition.to} | {transition.when} |")
    lines += ["", *(f"- **{name}**: {queue.holds}." for name, queue in QUEUES.items())]
    lines.append(f"- **{IDLE}**: slots that hold no path, in no queue.")
    return "\n".join(["", *lines, ""])


def performance_part(figures: Measured) -> str:
    """What stands between the markers: the table, on what it was measured, and what could not be."""
    lines = ["", *markdown(bench.rows(figures)), ""]
    if "scenes" in figures:
        lines += ["What each side took and counted on the scenes, per sample:", ""]
        lines += [*details(figures["scenes"]), ""]
    left_out = figures.get(bench.LEFT_OUT, {})
    beside = [figures[n]["mitsuba"]["version"] for n in ("cloud", "room") if n in figures]
    theirs = f"; Mitsuba {beside[0]} on as many threads" if beside else ""
    lines.append(f"{machine()}{theirs}. What is compared took turns; medians, and the range over the rounds.")
    if "scenes" in figures:
        million = figures["scenes"]["bare_loop"] / 1e6
        lines.append(f"The bare loop made {million:.0f} million steps a CPU second.")
    for name, reason in left_out.items():
        lines.append(f"Not measured: `{name}`, {reason}.")
    return "\n".join([*lines, ""])
