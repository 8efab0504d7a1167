"""Delta tracking against decomposition tracking as the control grows (Kutz et al. 2017, section 4).

The claim: collisions with the control need no look-up of the density, so that look-ups fall in proportion to
what the control leaves of the majorant, while the picture and its variance stay as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.colours import BLUE, GREEN, ORANGE, VERMILION
from recipes.drawing import EXACT, panels, save, table
from recipes.measuring import costs
from recipes.scenes import cube, noise

if TYPE_CHECKING:
    from pathlib import Path

SHARES = (0.0, 0.25, 0.5, 0.75, 0.9)
DEPTH = 8.0
"""Optical depth of the majorant across the cube."""


def run(output: Path, quick: bool) -> str:
    """Measure, draw, and return the table."""
    size, spp, rounds = (8, 4, 4) if quick else (64, 32, 6)
    field, found = noise(24), {}
    for share in SHARES[::2] if quick else SHARES:
        scene = cube(share + (1 - share) * field, DEPTH, size=size)
        names = {
            (technique, majorant): {"technique": technique, "majorant": majorant}
            for majorant in ("global", "grid")
            for technique in ("delta", "decomposition")
        }
        found[share] = costs(scene, names, spp, rounds)
    rows, ratios = [], {}
    for share, by in found.items():
        row: list[object] = [f"{share:g}"]
        for majorant in ("global", "grid"):
            ours, theirs = by["decomposition", majorant], by["delta", majorant]
            ratio = (
                ours.per_sample["lookups"] / theirs.per_sample["lookups"],
                ours.variance / theirs.variance,
                ours.times_slower(theirs),
            )
            ratios[share, majorant] = ratio
            row += list(ratio)
        rows.append(row)
    _draw(output, list(found), ratios)
    heads = ["least / greatest density"]
    heads += [f"{m}: {what}" for m in ("global", "grid") for what in ("look-ups", "variance", "CPU time")]
    return table(heads, rows)


def _draw(output: Path, shares: list[float], ratios: dict) -> None:
    figure, (left, right) = panels(2)
    line = np.linspace(0, 1, 20)
    left.plot(line, 1 - line, label="claim, one majorant: 1 − control / majorant", **EXACT)
    for majorant, colour, mark in (("global", BLUE, "o"), ("grid", GREEN, "s")):
        values = np.array([ratios[share, majorant] for share in shares])
        left.plot(shares, values[:, 0], mark, color=colour, label=f"measured, majorant {majorant}")
    right.axhline(1.0, **EXACT)
    for majorant, colours in (("global", (BLUE, VERMILION)), ("grid", (GREEN, ORANGE))):
        values = np.array([ratios[share, majorant] for share in shares])
        right.plot(shares, values[:, 2], "o-", color=colours[0], label=f"CPU time, {majorant}")
        right.plot(shares, values[:, 1], "^:", color=colours[1], label=f"variance, {majorant}")
    left.set(title="Look-ups", ylabel="decomposition / delta", ylim=(0, 1.15))
    right.set(title="What is gained by it", ylim=(0, 1.6))
    for axes in (left, right):
        axes.set_xlabel("least / greatest density: how large a control can be")
    save(figure, output)
