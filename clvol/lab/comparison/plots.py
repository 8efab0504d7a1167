"""Plots and pictures of a comparison, as PNG bytes."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.lab.colours import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION
from clvol.lab.comparison.figures import COSTS, Figures, relative_weight
from clvol.picture.image_io import shown_pixels
from clvol.picture.view_transform import View

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
UNITS = {"seconds": "seconds", "lookups": "density look-ups"}


def plots(findings: Findings) -> dict[str, bytes]:
    """PNG by name: error over each kind of cost, efficiency; those that can be drawn."""
    import matplotlib
    from matplotlib.figure import Figure

    drawn = {}
    with matplotlib.rc_context(STYLE):
        costs = [cost for cost in COSTS if any(getattr(f, cost)[-1] > 0 for f in findings.figures)]
        for cost in costs:
            for name, label in (("relmse", "relative MSE"), ("rmse", "RMSE")):
                figure = Figure(figsize=(5.6, 4.4), layout="constrained")
                _errors(figure.add_subplot(), findings, name, cost)
                figure.axes[0].set(xlabel=UNITS[cost], ylabel=label)
                drawn[f"{name}_over_{cost}"] = _png(figure)
        if len(findings.figures) > 1:
            figure = Figure(figsize=(9.2, 1.3 + 0.34 * len(findings.figures)), layout="constrained")
            _efficiencies(figure, findings)
            drawn["efficiency"] = _png(figure)
    return drawn


def _look(number: int) -> dict[str, Any]:
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[number // len(COLOURS) % len(DASHES)],
    }


def _errors(axes: Axes, findings: Findings, name: str, cost: str) -> None:
    """One error over one cost, log-log, with bands and a guide of the slope that noise has."""
    power = 0.5 if name == "rmse" else 1.0
    starts = []
    for number, figures in enumerate(findings.figures):
        curve = figures.mse if name == "rmse" else figures.relmse
        spent, value = getattr(figures, cost), np.maximum(curve.value, 0.0) ** power
        shown = (value > 0) & (spent > 0)
        if not shown.any():
            continue
        starts.append((float(spent[shown][0]), float(value[shown][0]), float(spent[shown][-1])))
        look = _look(number)
        low, high = (np.maximum(end, curve.value.min() * 1e-3) ** power for end in (curve.low, curve.high))
        axes.fill_between(spent[shown], low[shown], high[shown], color=look["color"], alpha=0.15, lw=0)
        label = figures.label + (" (biased)" if figures.biased else "")
        axes.plot(spent[shown], value[shown], marker="o", ms=3, lw=1.6, label=label, **look)
    axes.set(xscale="log", yscale="log")
    if starts:
        _guide(axes, starts, power)
    _plain_ticks(axes.xaxis)
    _plain_ticks(axes.yaxis)
    axes.grid(True, which="minor", color="#f2f2f2", linewidth=0.5)
    axes.figure.legend(fontsize=8, loc="outside lower center", ncols=3)


def _guide(axes: Axes, starts: list[tuple[float, float, float]], power: float) -> None:
    """A line of the slope that unbiased noise has, below the curves."""
    begin, _, end = min(starts)
    level = min(value * (start / begin) ** power for start, value, _ in starts) * 0.6
    values = [level, level * (end / begin) ** -power]
    slope = "-1/2" if power < 1 else "-1"
    axes.plot([begin, end], values, color="#999999", lw=1, ls=(0, (4, 3)), label=f"slope {slope}", zorder=1)


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
        _plain_ticks(axes.xaxis)
        axes.grid(False, axis="y")
    panels[0].set_yticks(places, [f.label for f in findings.figures])
    panels[0].set_ylim(-0.6, len(places) - 0.4)


def _plain_ticks(axis: Axis) -> None:
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


def picture(image: np.ndarray) -> bytes:
    """Linear radiance as a PNG as results are shown, pixel for pixel; what is not finite in magenta."""
    return _pixels(np.rint(255 * shown_pixels(image, None, View().resolved())).astype(np.uint8))


def error_scales(findings: Findings) -> tuple[float, float]:
    """What the error images of all combinations end at.

    The first is of a round's relative RMS error, the second of the relative difference of the mean.
    """
    spreads = [np.quantile(_spread(f, findings), 0.99) for f in findings.figures]
    differences = [np.quantile(np.abs(_difference(f, findings)), 0.99) for f in findings.figures]
    return max(float(max(spreads)), 1e-12), max(float(max(differences)), 1e-12)


def error_pictures(figures: Figures, findings: Findings, scales: tuple[float, float]) -> list[bytes]:
    """Where a round is noisy, and where the mean of all rounds is too bright (red) or too dark (blue)."""
    import matplotlib

    spread = np.clip(_spread(figures, findings) / scales[0], 0, 1)
    difference = np.clip(_difference(figures, findings) / scales[1], -1, 1)
    noisy = matplotlib.colormaps["magma"](spread)
    signed = matplotlib.colormaps["RdBu_r"](difference / 2 + 0.5)
    return [_pixels(np.rint(255 * colours[..., :3]).astype(np.uint8)) for colours in (noisy, signed)]


def _level(findings: Findings) -> np.ndarray:
    """What errors are relative to, (height, width): sqrt(F² + (DARK · mean F)²)."""
    level: np.ndarray = 1.0 / np.sqrt(relative_weight(findings.reference.image.mean(axis=-1)))
    return level


def _spread(figures: Figures, findings: Findings) -> np.ndarray:
    images, truth = figures.measured.images, findings.reference
    squares = sum((image - truth.image) ** 2 for image in images) / len(images) - truth.variance
    error: np.ndarray = np.sqrt(np.maximum(squares, 0.0).mean(axis=-1)) / _level(findings)
    return error


def _difference(figures: Figures, findings: Findings) -> np.ndarray:
    error: np.ndarray = (figures.image - findings.reference.image).mean(axis=-1) / _level(findings)
    return error


def _pixels(pixels: np.ndarray) -> bytes:
    from matplotlib.image import imsave

    stream = io.BytesIO()
    imsave(stream, pixels, format="png")
    return stream.getvalue()


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=160)
    return stream.getvalue()
