"""A ray's view as a figure: to the left what each technique walks, to the right what its walks estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from clvol.errors import printable
from clvol.lab.ray.view import CHANNEL_NAMES
from clvol.lab.ray.walks import UNNAMED, Walk, Watched, format_estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.gridspec import SubplotSpec

    from clvol.lab.ray.view import RayView

# Okabe and Ito's colours, which the colour-blind can tell apart
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#9A9A9A"
SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
STYLES = ("-", (0, (5, 1.5)), (0, (1.5, 1)), (0, (5, 1.5, 1.5, 1.5)))
CHANNEL_COLOURS = (VERMILION, GREEN, BLUE)
DISTANCE = "distance from the camera (scene lengths)"
BINS = 96
HEADROOM = 1.3
"""Panels to the right leave room for their legends."""


def draw(view: RayView) -> Figure:
    """The whole figure, for a slide: 16 inches wide, as high as what is watched needs."""
    rows = len(view.watched)
    figure = Figure(figsize=(16, max(9.0, 1.75 * rows + 1.9)), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.06, h_pad=0.05, wspace=0.03, hspace=0.0)
    left, right = figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
    panels = left.subgridspec(rows, 1, hspace=0.1)
    first = None
    for row, watched in enumerate(view.watched):
        first = _walks_panel(figure, panels[row], view, watched, first, row == rows - 1)
    _estimates(figure, right, view, first)
    figure.suptitle(_title(view), fontsize=15, fontweight="bold", parse_math=False)
    figure.legend(
        handles=_symbols(view),
        loc="outside lower center",
        ncols=5,
        frameon=False,
        fontsize=10,
        title="  ".join([*view.notes, *view.bound_notes]) or None,
        title_fontsize=9,
    )
    return figure


def _title(view: RayView) -> str:
    channel = f", {CHANNEL_NAMES[view.channel]} channel" if len(view.sigma_t) > 1 else ""
    x, y = view.pixel
    where = "" if view.medium == UNNAMED else f", in {view.medium}"
    return f"{printable(view.scene)}, ray through pixel ({x}, {y}){where}{channel}"


def _colour(view: RayView, watched: Watched) -> str:
    """Colours count anew in each family: techniques and transmittances never share a panel."""
    family = [other for other in view.watched if other.family == watched.family]
    return SERIES[family.index(watched) % len(SERIES)]


def _style(view: RayView, watched: Watched) -> object:
    family = [other for other in view.watched if other.family == watched.family]
    return STYLES[family.index(watched) % len(STYLES)]


# -- the left: walks over the density ----------------------------------------------------------------


def _walks_panel(
    figure: Figure,
    place: SubplotSpec,
    view: RayView,
    watched: Watched,
    first: Axes | None,
    last: bool,
) -> Axes:
    """Walks, one a row, over density, majorant and control; returns the axes whose distances others share."""
    strip, below = place.subgridspec(2, 1, height_ratios=(1.0, 1.35), hspace=0.0)
    walks = figure.add_subplot(strip, sharex=first)
    medium = figure.add_subplot(below, sharex=walks)
    colour = _colour(view, watched)
    kind = "collisions" if watched.family == "technique" else "transmittance"
    residual = "residual " if watched.name == "residual-ratio" else ""
    majorant = "" if watched.majorant == "none" else f", {residual}majorant {watched.majorant}"
    title = f"{watched.label}  ({kind}{majorant})"
    walks.set_title(title, loc="left", fontsize=11, color=colour, weight="bold")
    for row, walk in enumerate(watched.walks):
        _draw_walk(walks, view, walk, row, colour)
    walks.set_ylim(len(watched.walks) - 0.4, -0.6)
    walks.set_yticks([])
    walks.set_ylabel("walks", fontsize=9)
    walks.tick_params(labelbottom=False, bottom=False)
    _draw_medium(medium, view, watched)
    medium.tick_params(labelbottom=last)
    if last:
        medium.set_xlabel(DISTANCE)
    for axes in (walks, medium):
        axes.spines[["top", "right"]].set_visible(False)
    walks.spines["bottom"].set_color("#CCCCCC")
    return first or walks


def _draw_walk(axes: Axes, view: RayView, walk: Walk, row: int, colour: str) -> None:
    """A line as far as the walk goes, and a sign for each of its collisions."""
    start, length = view.place.distance, view.place.length
    reach = walk.reach(view.channel)
    lost = reach is not None and walk.end is None
    end = length if reach is None else reach
    axes.plot([start, start + end], [row, row], color=colour, lw=1.0, alpha=0.6, zorder=1)
    if reach is None:
        axes.plot([start + min(length, view.window[1])], [row], ">", color=colour, ms=5, clip_on=False)
    found = {"null": [], "real": [], "control": []}
    for collision in walk.collisions:
        found[collision.kind].append(start + collision.t)
    if _shows_lookups(walk):
        t = start + np.array(walk.lookups)
        axes.plot(t, np.full(len(t), row), "|", color="#666666", ms=4, mew=0.7, zorder=2)
    for kind, t in found.items():
        axes.plot(t, [row] * len(t), zorder=3, **SIGNS[kind])
    if lost:
        axes.plot([start + end], [row], "x", color=BLACK, ms=6, mew=1.5, zorder=4)


def _shows_lookups(walk: Walk) -> bool:
    """Whether look-ups are to be seen by themselves: where they are no collisions."""
    return len(walk.lookups) > len(walk.collisions)


SIGNS = {
    "null": {"marker": "o", "ls": "", "mfc": "white", "mec": BLACK, "ms": 4.5, "mew": 0.9},
    "real": {"marker": "o", "ls": "", "mfc": VERMILION, "mec": BLACK, "ms": 6.5, "mew": 0.8},
    "control": {"marker": "D", "ls": "", "mfc": SKY, "mec": BLACK, "ms": 6, "mew": 0.8},
}


def _draw_medium(axes: Axes, view: RayView, watched: Watched) -> None:
    """Density, majorant and control against distance."""
    start = view.place.distance
    t, sigma = start + (view.edges[1:] + view.edges[:-1]) / 2, view.sigma_t
    axes.fill_between(t, sigma[view.channel], color="#D9D9D9", lw=0)
    for channel, values in enumerate(sigma):
        single = len(sigma) == 1
        axes.plot(
            *(t, values),
            color="#4D4D4D" if single else CHANNEL_COLOURS[channel],
            lw=1.6 if channel == view.channel else 0.9,
        )
    top = sigma.max()
    for values, how in ((watched.rate(), MAJORANT), (watched.control(view.channel), CONTROL)):
        if values is not None:
            planes = start + np.append(watched.cells[:, 0], watched.cells[-1, 1])
            axes.stairs(values, planes, baseline=None, **how)
            top = max(top, values.max())
    axes.set_ylim(0, 1.08 * min(top, 8 * sigma.max()))
    axes.set_xlim(start + view.window[0], start + view.window[1])
    axes.set_ylabel("σ (1/length)", fontsize=9)


MAJORANT = {"color": BLACK, "lw": 1.2}
CONTROL = {"color": BLUE, "lw": 1.4, "ls": (0, (3, 1))}


def _symbols(view: RayView) -> list[Line2D | Patch]:
    """The legend of the left column: only what occurs."""
    kinds = {c.kind for w in view.watched for walk in w.walks for c in walk.collisions}
    names = {
        "null": "null collision",
        "real": "real collision",
        "control": "collision with the control, no look-up",
    }
    channels = view.sigma_t.shape[0]
    handles: list[Line2D | Patch] = [
        Patch(color="#D9D9D9", label="density σt")
        if channels == 1
        else Line2D([], [], color=CHANNEL_COLOURS[c], label=f"σt, {CHANNEL_NAMES[c]}")
        for c in range(channels)
    ]
    if any(w.rate() is not None for w in view.watched):
        handles.append(Line2D([], [], label="majorant (rate of tentative collisions)", **MAJORANT))
    if any(w.control(view.channel) is not None for w in view.watched):
        handles.append(Line2D([], [], label="control", **CONTROL))
    handles += [Line2D([], [], label=names[kind], **SIGNS[kind]) for kind in names if kind in kinds]
    if any(_shows_lookups(walk) for w in view.watched for walk in w.walks):
        handles.append(Line2D([], [], marker="|", ls="", color="#666666", label="look-up"))
    if any(w.family == "transmittance" for w in view.watched):
        handles.append(Line2D([], [], marker="x", ls="", color=BLACK, label="estimate becomes 0"))
    handles.append(Line2D([], [], marker=">", ls="", color="#666666", label="leaves the medium"))
    return handles


# -- the right: what walks estimate ------------------------------------------------------------------


def _estimates(figure: Figure, place: SubplotSpec, view: RayView, shared: Axes) -> None:
    """Free paths and weights of the techniques, running estimates of the transmittances."""
    techniques = [w for w in view.watched if w.family == "technique"]
    shadows = [w for w in view.watched if w.family == "transmittance"]
    draws = [(_free_paths, techniques), (_weights, techniques)] if techniques else []
    draws.append((_transmittance, shadows))
    cells = place.subgridspec(len(draws), 1, hspace=0.1, height_ratios=[1.0, 0.85, 1.3][-len(draws) :])
    for cell, (panel, watched) in zip(cells, draws, strict=True):
        axes = figure.add_subplot(cell, sharex=shared)
        panel(axes, view, watched)
        axes.set_xlabel(DISTANCE)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", color="#EEEEEE", zorder=0)
        axes.set_axisbelow(True)


def _free_paths(axes: Axes, view: RayView, watched: list[Watched]) -> None:
    """Weighted histograms of real collisions, with a band of two standard errors, and sigma_t T."""
    start, edges = view.place.distance, np.linspace(*view.window, BINS + 1)
    middles = (view.edges[1:] + view.edges[:-1]) / 2
    transmittance = np.sqrt(view.transmittance[view.channel, 1:] * view.transmittance[view.channel, :-1])
    exact = view.sigma_t[view.channel] * transmittance
    axes.plot(start + middles, exact, color=BLACK, lw=1.3, label="exact σt T", zorder=4)
    for one in watched:
        density, error = one.free_path_density(edges, view.channel)
        colour = _colour(view, one)
        axes.fill_between(
            np.repeat(start + edges, 2)[1:-1],
            np.repeat(density - 2 * error, 2),
            np.repeat(density + 2 * error, 2),
            color=colour,
            alpha=0.25,
            lw=0,
        )
        how = {"color": colour, "ls": _style(view, one), "label": one.label}
        axes.stairs(density, start + edges, baseline=None, lw=1.4, zorder=3, **how)
    axes.set_title(
        f"Free paths: {len(watched[0].outcomes):,} walks each, weighted, ± 2 standard errors",
        loc="left",
        fontsize=11,
    )
    axes.set_ylim(0, HEADROOM * max(exact.max(), 1e-30))
    axes.set_ylabel("density (1/length)")
    axes.legend(fontsize=9, edgecolor="none", framealpha=0.85, loc="upper right", ncols=4)


def _weights(axes: Axes, view: RayView, watched: list[Watched]) -> None:
    """The weight of each walk that is shown, from its start to its collision."""
    start, length, channel = view.place.distance, view.place.length, view.channel
    plain = []
    for one in watched:
        values = [value[channel] for walk in one.walks for _, value in walk.weights]
        values += [walk.value[channel] for walk in one.walks]
        if np.allclose(values, 1.0, atol=1e-5):  # but for rounding
            plain.append(one.label)
            continue
        colour = _colour(view, one)
        for number, walk in enumerate(one.walks):
            t = [0.0] + [t for t, _ in walk.weights]
            w = [1.0] + [value[channel] for _, value in walk.weights]
            if walk.end is None:
                t, w = [*t, length], [*w, walk.value[channel]]
            axes.plot(
                start + np.array(t),
                w,
                drawstyle="steps-post",
                color=colour,
                ls=_style(view, one),
                lw=1.3,
                alpha=0.85,
                label=None if number else one.label,
            )
            if walk.end is not None:
                axes.plot([start + t[-1]], [w[-1]], "o", mfc=VERMILION, mec=BLACK, ms=6, mew=0.8)
    if plain:
        axes.axhline(1.0, color=GREY, lw=1.5, zorder=1, label=f"{', '.join(plain)}: always 1")
    axes.set_title(f"Weights of the {len(watched[0].walks)} walks shown", loc="left", fontsize=11)
    axes.set_ylabel("weight")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0), HEADROOM * max(high, 1.1))
    axes.legend(fontsize=9, edgecolor="none", framealpha=0.85, loc="upper right", ncols=3)


def _transmittance(axes: Axes, view: RayView, watched: list[Watched]) -> None:
    """Exact transmittance, that of control and residual, and the running estimates of walks."""
    start, edges, channel = view.place.distance, view.edges, view.channel
    exact = view.transmittance[channel]
    for one in watched:
        colour = _colour(view, one)
        mean, error = one.transmitted(channel)
        for number, walk in enumerate(one.walks):
            if one.name not in ("ratio", "residual-ratio", "delta"):
                break  # nothing is known before its end
            label = None if number else f"{one.label}, {len(one.walks)} walks"
            running = one.running_estimate(walk, edges, channel)
            how = {"color": colour, "ls": _style(view, one), "label": label}
            axes.plot(start + edges, running, lw=1.0, alpha=0.75, **how)
        axes.errorbar(
            [start + view.window[1]],
            [mean],
            [2 * error],
            fmt="s",
            color=colour,
            ms=6,
            clip_on=False,
            capsize=3,
            zorder=5,
            label=f"{one.label}, {len(one.outcomes):,} walks: {format_estimate(mean, error)}",
        )
        if one.name == "residual-ratio" and one.control(channel) is not None:
            control = np.exp(-one.control_depth(edges, channel))
            axes.plot(start + edges, control, label="control's transmittance", **CONTROL)
            residual = exact / np.maximum(control, 1e-300)
            axes.plot(start + edges, residual, color=GREEN, ls=":", lw=1.8, label="residual's transmittance")
    label = f"exact T: {exact[-1]:.3g} at the end"
    axes.plot(start + edges, exact, color=BLACK, lw=2.2, label=label, zorder=4)
    axes.set_title("Transmittance from the medium's entry", loc="left", fontsize=11)
    axes.set_ylabel("transmittance")
    low, high = axes.get_ylim()
    axes.set_ylim(max(min(low, 0.0), -1.0), 1.6 * min(high, 2.0))
    axes.legend(fontsize=9, edgecolor="none", framealpha=0.85, loc="upper right", ncols=2)
