"""How the recipes' plots look, and their tables in Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.figure import Figure

from clvol.lab.comparison.plots import STYLE, plain_ticks

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

EXACT: dict[str, Any] = {"color": "#888888", "lw": 1.2, "ls": (0, (4, 3)), "zorder": 1}
"""What theory says, beside which measured points stand."""


def panels(count: int) -> tuple[Figure, list[Axes]]:
    """A figure with panels side by side."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.6 * count, 3.9), layout="constrained")
        return figure, list(figure.subplots(1, count, squeeze=False)[0])


def save(figure: Figure, output: Path) -> None:
    """Write the figure, with legends, and plain numbers on logarithmic axes."""
    with matplotlib.rc_context(STYLE):
        for axes in figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                if axis.get_scale() == "log":
                    plain_ticks(axis)
            if axes.get_legend_handles_labels()[0]:
                axes.legend(fontsize=8)
        figure.savefig(output, dpi=120)


def table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Rows as Markdown; numbers with three digits."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in row) + " |" for row in lines)


def _cell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
