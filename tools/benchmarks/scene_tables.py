"""The figures of the benchmark's scenes as tables: on the screen, and in README and docs/performance.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.cloud import Z_LIMIT
from benchmarks.peers import CLVOL, CYCLES, MITSUBA
from benchmarks.tables import Row, at_least, ranged, show

if TYPE_CHECKING:
    from benchmarks.tables import Figures

AIMS = {"cloud": 20, "cloud_dense": 10, "chroma": 25, "box_smoke": 10, "thin_sparse": 10, "emissive": 10}
"""Times the efficiency of the best other program."""
OTHERS = (MITSUBA, CYCLES)
NONE = "–"
DETAILS = {
    "efficiency, millions": lambda side: ranged({k: v / 1e6 for k, v in side["efficiency"].items()}),
    "variance of a sample": lambda side: f"{side['variance']:.3g}",
    "CPU µs a sample": lambda side: ranged(side["microseconds"]),
    "mean of the image": lambda side: f"{side['mean']:.5f} ± {side['standard_error']:.5f}",
    "samples a turn": lambda side: str(side["spp"]),
    "set-up, seconds": lambda side: f"{side['setup_wall']:.2f}",
    "first picture, seconds": lambda side: f"{side['first_seconds']:.1f}",
    "look-ups a sample": lambda side: _count(side, "lookups"),
    "majorant cells": lambda side: _count(side, "cells_crossed"),
    "shadow rays": lambda side: _count(side, "shadow_rays"),
    "scatterings, absorptions": lambda side: _count(side, "real_collisions"),
    "look-ups, of the bare loop's": lambda side: _percent(side, "share_of_bare_loop"),
    "outside of the stages": lambda side: _percent(side, "outside_share"),
}
"""What is shown of each side."""
IN_PAGE = (
    "variance of a sample",
    "CPU µs a sample",
    "look-ups a sample",
    "majorant cells",
    "shadow rays",
    "look-ups, of the bare loop's",
    "set-up, seconds",
    "first picture, seconds",
)
"""The part of it that is in docs/performance.md."""


def _count(side: Figures, name: str) -> str:
    return f"{side[name]:.3g}" if name in side else NONE


def _percent(side: Figures, name: str) -> str:
    return f"{100 * side[name]:.2g} %" if name in side else NONE


def show_scenes(figures: Figures) -> None:
    """A table for each scene, a column for each side."""
    print(f"the bare loop: {figures['bare_loop'] / 1e6:.0f} million steps a CPU second")
    for name, scene in figures["scenes"].items():
        sides = scene["sides"]
        rows = [(text, *(of(side) for side in sides.values())) for text, of in DETAILS.items()]
        stages = dict.fromkeys(stage for side in sides.values() for stage in side.get("stages", {}))
        for stage in stages:
            times = (side.get("stages", {}).get(stage) for side in sides.values())
            rows.append((f"{stage}, µs a sample", *(NONE if t is None else f"{t:.3g}" for t in times)))
        over = [ranged(scene["over"][kind]) if kind in scene["over"] else "" for kind in sides]
        apart = [f"{scene['z'][kind]:+.1f}" if kind in scene["z"] else "" for kind in sides]
        rows += [("clvol's efficiency over it", *over), ("difference of the means, z", *apart)]
        title = f"{scene['letter']} {name}: {scene['about']}; {figures['rounds']} rounds by turns"
        show(f"{title}, {figures['threads']} threads", ["", *(s["label"] for s in sides.values())], rows)


def scene_rows(figures: Figures) -> list[Row]:
    """For each scene the efficiency over the others; then how far the means are apart."""
    rows = [_scene_row(name, scene) for name, scene in figures["scenes"].items()]
    apart = [
        (abs(z), f"{scene['letter']}, {scene['sides'][kind]['label']}")
        for scene in figures["scenes"].values()
        for kind, z in scene["z"].items()
    ]
    if apart:
        most, where = max(apart)
        text = f"{most:.1f} standard errors ({where})"
        limit = f"within {Z_LIMIT:g} standard errors"
        rows.append(Row("the largest difference of two means on these scenes", text, limit, most < Z_LIMIT))
    return rows


def _scene_row(name: str, scene: Figures) -> Row:
    sides, over = scene["sides"], scene["over"]
    ours = ranged({k: v / 1e6 for k, v in sides[CLVOL]["efficiency"].items()})
    times = [f"{ranged(over[kind])} times {sides[kind]['label']}" for kind in over]
    figure = f"scene {scene['letter']}, {scene['about']}: efficiency, millions, and over that of others"
    measured = "; ".join([ours, *times])
    others = [over[kind]["median"] for kind in OTHERS if kind in over]
    return at_least(figure, measured, AIMS[name], min(others)) if others else Row(figure, measured)


def _two_digits(number: float) -> str:
    """As 0.53, 8.1, 42 or 5,900."""
    return f"{float(f'{number:.2g}'):,.0f}" if number >= 10 else f"{number:.2g}"


def overview(figures: Figures) -> list[str]:
    """Lines of Markdown: efficiency over that of each other renderer, a row for each scene."""
    kinds = [k for k in OTHERS if any(k in s["over"] for s in figures["scenes"].values())]
    labels = {kind: side["label"] for s in figures["scenes"].values() for kind, side in s["sides"].items()}
    heads = [f"times {labels[kind]}" for kind in kinds]
    lines = ["| scene | " + " | ".join(["clvol, millions", *heads]) + " |", "|---" * (len(kinds) + 2) + "|"]
    for scene in figures["scenes"].values():
        ours = f"{scene['sides'][CLVOL]['efficiency']['median'] / 1e6:.3g}"
        times = [_two_digits(scene["over"][k]["median"]) if k in scene["over"] else NONE for k in kinds]
        lines.append("| " + " | ".join([f"{scene['letter']}: {scene['about']}", ours, *times]) + " |")
    return lines


def details(figures: Figures) -> list[str]:
    """Lines of Markdown: what every side took and counted."""
    lines = ["| scene | by | " + " | ".join(IN_PAGE) + " |", "|---" * (len(IN_PAGE) + 2) + "|"]
    for scene in figures["scenes"].values():
        for side in scene["sides"].values():
            cells = [scene["letter"], side["label"], *(DETAILS[name](side) for name in IN_PAGE)]
            lines.append("| " + " | ".join(cells) + " |")
    return lines
