"""Plots of a comparison, as PNG bytes."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from clvol.lab.colours import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION
from clvol.lab.comparison.figures import COSTS, Figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from clvol.lab.comparison.findings import Findings

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE, "#7a5195", "#555555")
DASHES = ("-", "--", "-.", ":")
STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#888888",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
}
_LEGEND = 64
"""Characters that a row of a legend has room for."""
UNITS = {"spp": "samples a pixel", "seconds": "seconds", "lookups": "density look-ups"}


def plots(findings: Findings) -> dict[str, bytes]:
    """PNG by name: error of one render over samples and costs, efficiency, error of means of renders."""
    import matplotlib
    from matplotlib.figure import Figure

    drawn = {}
    with matplotlib.rc_context(STYLE):
        for cost in UNITS:
            if any(getattr(f.one_render, cost)[-1] > 0 for f in findings.figures):
                curves = [_of_one_render(f, cost) for f in findings.figures]
                drawn[f"one_render_over_{cost}"] = _errors(findings, curves, UNITS[cost])
        if len(findings.figures) > 1:
            figure = Figure(figsize=(9.2, 1.3 + 0.34 * len(findings.figures)), layout="constrained")
            _efficiencies(figure, findings)
            drawn["efficiency"] = _png(figure)
        curves = [_of_means(f) for f in findings.figures]
        drawn["means_over_seconds"] = _errors(findings, curves, UNITS["seconds"])
    return drawn


class _Drawn(NamedTuple):
    """An error over what was spent for it, with the ends of its 95 % interval: float64 (n,) each."""

    spent: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


def _of_one_render(figures: Figures, cost: str) -> _Drawn:
    one = figures.one_render
    return _Drawn(getattr(one, cost), one.relmse, one.low, one.high)


def _of_means(figures: Figures) -> _Drawn:
    curve = figures.relmse
    return _Drawn(figures.seconds, curve.value, curve.low, curve.high)


def _look(number: int) -> dict[str, Any]:
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[number // len(COLOURS) % len(DASHES)],
    }


def _errors(findings: Findings, curves: list[_Drawn], unit: str) -> bytes:
    """Relative MSE over one cost, log-log, with bands and a guide of the slope that noise has."""
    from matplotlib.figure import Figure

    longest = max(len(figures.label) for figures in findings.figures)
    columns = min(3, max(1, _LEGEND // (longest + 6)))
    rows = -(-(len(findings.figures) + 1) // columns)
    figure = Figure(figsize=(4.4, 3.4 + 0.17 * rows), layout="constrained")
    axes = figure.add_subplot()
    starts = []
    for number, (figures, curve) in enumerate(zip(findings.figures, curves, strict=True)):
        shown = (curve.value > 0) & (curve.spent > 0)
        if not shown.any():
            continue
        spent, value, low, high = (ends[shown] for ends in curve)
        starts.append((float(spent[0]), float(value[0]), float(spent[-1])))
        look = _look(number)
        low, high = (np.maximum(end, value.min() * 1e-3) for end in (low, high))
        axes.fill_between(spent, low, high, color=look["color"], alpha=0.15, lw=0)
        label = figures.label + (" (biased)" if figures.biased else "")
        axes.plot(spent, value, marker="o", ms=4, lw=1.6, label=label, **look)
    axes.set(xscale="log", yscale="log", xlabel=unit, ylabel="relative MSE")
    if starts:
        _guide(axes, starts)
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    axes.grid(True, which="minor", color="#f2f2f2", linewidth=0.5)
    if starts:  # an error to show, and so an entry
        figure.legend(fontsize=8, loc="outside lower center", ncols=columns)
    return _png(figure)


def _guide(axes: Axes, starts: list[tuple[float, float, float]]) -> None:
    """A line of the slope that unbiased independent noise has, below the curves."""
    begin = min(starts)[0]
    end = max(last for *_, last in starts)
    level = min(value * start / begin for start, value, _ in starts) * 0.6
    if end > begin:
        values = [level, level * begin / end]
        axes.plot([begin, end], values, color="#999999", lw=1, ls=(0, (4, 3)), label="slope -1", zorder=1)


def _efficiencies(figure: Figure, findings: Findings) -> None:
    """Ratios with their intervals; filled where they are significant."""
    panels = figure.subplots(1, len(COSTS), sharey=True)
    places = np.arange(len(findings.figures))[::-1]
    for axes, (cost, word) in zip(panels, COSTS.items(), strict=True):
        axes.axvline(1.0, color="#999999", lw=1, ls=(0, (4, 3)))
        ends = [1.0]
        for place, (number, figures) in zip(places, enumerate(findings.figures), strict=True):
            e = figures.efficiency.get(cost)
            if e is None or not 0 < e.ratio.value < math.inf:
                axes.text(
                    0.5, place, "not known", transform=axes.get_yaxis_transform(), va="center", fontsize=8
                )
                continue
            colour = _look(number)["color"]
            ends += [e.ratio.low, e.ratio.high]
            axes.plot(
                [e.ratio.low, e.ratio.high], [place, place], color=colour, lw=2.5, solid_capstyle="round"
            )
            filled = colour if e.significant or figures.label == findings.baseline else "white"
            axes.plot(e.ratio.value, place, "o", ms=7, mec=colour, mfc=filled, mew=1.8)
        axes.set(xscale="log", xlabel=f"efficiency by {word}, relative to {findings.baseline}")
        finite = [end for end in ends if 0 < end < math.inf]
        axes.set_xlim(min(finite) / 1.3, max(finite) * 1.3)
        plain_ticks(axes.xaxis)
        axes.grid(False, axis="y")
    panels[0].set_yticks(places, [f.label for f in findings.figures])
    panels[0].set_ylim(-0.6, len(places) - 0.4)


def plain_ticks(axis: Axis) -> None:
    """Plain numbers on a logarithmic axis whose range is set: at least two, and not too many."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high / low < 4:
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    else:
        subs = (1, 2, 3, 5) if high / low < 20 else (1, 2, 5) if high / low < 300 else (1,)
        axis.set_major_locator(LogLocator(subs=subs, numticks=10))
    axis.set_major_formatter(FuncFormatter(lambda value, _: plain_number(value)))
    axis.set_minor_formatter(NullFormatter())


def plain_number(value: float) -> str:
    """0.06 or 2000; powers of ten only where noughts would have to be counted."""
    if not value > 0 or 1e-4 <= value < 1e5:
        return f"{value:g}"
    digits, power = f"{value:.3e}".split("e")
    digits = digits.rstrip("0").rstrip(".")
    return f"$10^{{{int(power)}}}$" if digits == "1" else f"{digits}·$10^{{{int(power)}}}$"


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=160)
    return stream.getvalue()
