"""Global majorant, grid and kd-tree as a volume gets emptier (Yue et al. 2010).

The claim: a tree whose leaves follow the density needs far fewer look-ups than one bound for the volume, the
more so the emptier it is, and fewer cells than a grid.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol.lab.colours import BLUE, GREEN, VERMILION
from recipes.drawing import panels, save, table
from recipes.measuring import costs
from recipes.scenes import cube

if TYPE_CHECKING:
    from pathlib import Path

MAJORANTS = {"global": VERMILION, "grid": BLUE, "kdtree": GREEN}
BLOBS = (64, 16, 4, 1)
DEPTH = 40.0
"""Optical depth of the greatest density across the cube."""
CELLS = 64


def run(output: Path, quick: bool) -> str:
    """Measure, draw, and return the table."""
    size, spp, rounds = (8, 4, 4) if quick else (64, 32, 6)
    combinations = {name: {"technique": "delta", "majorant": name} for name in MAJORANTS}
    found, rows = {}, []
    for count in BLOBS[-1:] if quick else BLOBS:
        density = blobs(count)
        share = float((density > 0).mean())
        found[share] = costs(cube(density, DEPTH, size=size), combinations, spp, rounds)
        for name, cost in found[share].items():
            slower = cost.times_slower(found[share]["grid"])
            counts = cost.per_sample["lookups"], cost.per_sample["cells_crossed"]
            rows.append([f"{100 * share:.1f} %", f"`{name}`", *counts, slower])
    _draw(output, found)
    return table(
        ["filled", "majorant", "look-ups a sample", "cells a sample", "CPU time over the grid's"], rows
    )


def blobs(count: int) -> np.ndarray:
    """So many small blobs in an empty cube, float32 (CELLS, CELLS, CELLS)."""
    random, axis = np.random.default_rng(2), (np.arange(CELLS) + 0.5) / CELLS
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij", sparse=True)
    density = np.zeros((CELLS,) * 3)
    for centre in random.uniform(0.15, 0.85, (count, 3)):
        squared = (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2
        density = np.maximum(density, 1 - squared / 0.12**2)
    return np.maximum(density, 0.0).astype(np.float32)


def _draw(output: Path, found: dict) -> None:
    figure, axes = panels(3)
    shares = sorted(found)
    for name, colour in MAJORANTS.items():
        costs_of = [found[share][name] for share in shares]
        slower = [
            cost.times_slower(found[share]["grid"]) for cost, share in zip(costs_of, shares, strict=True)
        ]
        values = (
            [cost.per_sample["lookups"] for cost in costs_of],
            [cost.per_sample["cells_crossed"] for cost in costs_of],
            slower,
        )
        for panel, value in zip(axes, values, strict=True):
            panel.plot([100 * share for share in shares], value, "o-", color=colour, label=name)
    titles = ("Look-ups a sample", "Cells a sample", "CPU time over the grid's")
    for panel, title in zip(axes, titles, strict=True):
        panel.set(xscale="log", yscale="log", title=title, xlabel="voxels that are filled, %")
    axes[2].set(yscale="linear", ylim=(0, None))
    save(figure, output)
