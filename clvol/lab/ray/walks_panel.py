"""The left of a ray's figure: the walks of each technique and transmittance, over the medium they are in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from clvol.lab.colours import BLACK
from clvol.lab.ray.looks import CHANNEL_COLOURS, CONTROL, DISTANCE, MAJORANT, SIGNS, colour
from clvol.lab.ray.watched import CHANNEL_NAMES, WatchedRay

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

    from clvol.lab.ray.walks import Walk, Watched


def walks_panel(
    figure: Figure,
    place: SubplotSpec,
    view: WatchedRay,
    watched: Watched,
    first: Axes | None,
    last: bool,
) -> Axes:
    """Walks, one a row, over density, majorant and control; returns the axes whose distances others share."""
    rows = place.subgridspec(2, 1, height_ratios=(1.0, 1.35), hspace=0.0)
    walks = figure.add_subplot(rows[0], sharex=first)
    medium = figure.add_subplot(rows[1], sharex=walks)
    look = colour(view, watched)
    kind = "collisions" if watched.family == "technique" else "transmittance"
    residual = "residual " if watched.name == "residual-ratio" else ""
    majorant = "" if watched.majorant == "none" else f", {residual}majorant {watched.majorant}"
    title = f"{watched.label}  ({kind}{majorant})"
    walks.set_title(title, loc="left", fontsize=11, color=look, weight="bold")
    for row, walk in enumerate(watched.walks):
        _draw_walk(walks, view, walk, row, look)
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


def _draw_walk(axes: Axes, view: WatchedRay, walk: Walk, row: int, look: str) -> None:
    """A line as far as the walk goes, and a sign for each of its collisions."""
    start, length = view.place.distance, view.place.length
    reach = walk.reach(view.channel)
    lost = reach is not None and walk.end is None
    end = length if reach is None else reach
    axes.plot([start, start + end], [row, row], color=look, lw=1.0, alpha=0.6, zorder=1)
    if reach is None:
        axes.plot([start + min(length, view.window[1])], [row], ">", color=look, ms=5, clip_on=False)
    found: dict[str, list[float]] = {"null": [], "real": [], "control": []}
    for collision in walk.collisions:
        found[collision.kind].append(start + collision.t)
    if _shows_lookups(walk):
        at = start + np.array(walk.lookups)
        axes.plot(at, np.full(len(at), row), "|", color="#666666", ms=4, mew=0.7, zorder=2)
    for kind, t in found.items():
        axes.plot(t, [row] * len(t), zorder=3, **SIGNS[kind])
    if lost:
        axes.plot([start + end], [row], "x", color=BLACK, ms=6, mew=1.5, zorder=4)


def _shows_lookups(walk: Walk) -> bool:
    """Whether look-ups are to be seen by themselves: where they are no collisions."""
    return len(walk.lookups) > len(walk.collisions)


def _draw_medium(axes: Axes, view: WatchedRay, watched: Watched) -> None:
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
        if values is not None and watched.cells is not None:
            planes = start + np.append(watched.cells["t"], watched.cells["t_end"][-1]).astype(np.float64)
            axes.stairs(values, planes, baseline=None, **how)
            top = max(top, values.max())
    axes.set_ylim(0, 1.08 * min(top, 8 * sigma.max()))
    axes.set_xlim(start + view.window[0], start + view.window[1])
    axes.set_ylabel("σ (1/length)", fontsize=9)


def symbols(view: WatchedRay) -> list[Line2D | Patch]:
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
