"""Paths in flight: time per stage, launches and memory for several pool sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from benchmarks.efficiency import spread
from benchmarks.tables import Figures, ranged, show

if TYPE_CHECKING:
    from scene_options import OpenScene


def measure_pool(opened: OpenScene, sizes: list[int], spp: int, rounds: int) -> Figures:
    """Seconds per stage for each pool size, by turns."""
    runs: dict[int, list[dict[str, Any]]] = {size: [] for size in sizes}
    opened.render(1, 0)
    for _ in range(rounds):
        for size in sizes:
            runs[size].append(opened.render(spp, 0, size).result.stats)
    figures: Figures = {}
    for size, stats in runs.items():
        stages = {
            k: spread([s["seconds"][k] for s in stats])
            for k in stats[0]["seconds"]
            if k not in ("setup", "kernels")
        }
        same = {k: stats[0][k] for k in ("paths", "slots", "bytes_per_slot")}
        launches = spread([s["launches"] for s in stats])
        figures[str(size)] = same | {"seconds": stages, "launches": launches}
    return figures


def show_pool(figures: Figures) -> None:
    """One row per pool size: the median of each stage, the spread of the whole."""
    first = next(iter(figures.values()))
    stages = [name for name in first["seconds"] if name != "render"]
    rows = []
    for figure in figures.values():
        seconds = figure["seconds"]
        rows.append(
            (
                str(figure["slots"]),
                f"{figure['launches']['median']:.0f}",
                *(f"{seconds[name]['median']:.3f}" for name in stages),
                ranged(seconds["render"]),
                f"{figure['paths'] / seconds['render']['median'] / 1e6:.2f}",
            )
        )
    columns = [
        "slots",
        "launches",
        *(s.replace("_", " ") for s in stages),
        "render",
        "M paths/s",
    ]
    show(
        f"pool: seconds per stage, {first['paths']} paths, {first['bytes_per_slot']} bytes per slot",
        columns,
        rows,
    )
