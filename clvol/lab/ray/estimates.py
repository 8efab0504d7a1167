"""The right of a ray's figure: what walks estimate, free paths, weights and transmittance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.lab.colours import BLACK, GREEN, GREY, VERMILION
from clvol.lab.ray.looks import CONTROL, DISTANCE, colour, style
from clvol.lab.ray.walks import Watched, format_estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

    from clvol.lab.ray.watched import WatchedRay

BINS = 96
HEADROOM = 1.3
"""Panels leave room for their legends."""


def estimates(figure: Figure, place: SubplotSpec, view: WatchedRay, shared: Axes | None) -> None:
    """Free paths and weights of the techniques, running estimates of the transmittances."""
    techniques = [w for w in view.watched if w.family == "technique"]
    shadows = [w for w in view.watched if w.family == "transmittance"]
    draws = [(_free_paths, techniques), (_weights, techniques)] if techniques else []
    draws.append((_transmittance, shadows))
    cells = place.subgridspec(len(draws), 1, hspace=0.1, height_ratios=[1.0, 0.85, 1.3][-len(draws) :])
    for row, (panel, watched) in enumerate(draws):
        axes = figure.add_subplot(cells[row], sharex=shared)
        panel(axes, view, watched)
        axes.set_xlabel(DISTANCE)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", color="#EEEEEE", zorder=0)
        axes.set_axisbelow(True)


def _free_paths(axes: Axes, view: WatchedRay, watched: list[Watched]) -> None:
    """Weighted histograms of real collisions, with a band of two standard errors, and sigma_t T."""
    start, edges = view.place.distance, np.linspace(*view.window, BINS + 1)
    middles = (view.edges[1:] + view.edges[:-1]) / 2
    transmittance = np.sqrt(view.transmittance[view.channel, 1:] * view.transmittance[view.channel, :-1])
    exact = view.sigma_t[view.channel] * transmittance
    axes.plot(start + middles, exact, color=BLACK, lw=1.3, label="exact σt T", zorder=4)
    for one in watched:
        density, error = one.free_path_density(edges, view.channel)
        look = colour(view, one)
        axes.fill_between(
            np.repeat(start + edges, 2)[1:-1],
            np.repeat(density - 2 * error, 2),
            np.repeat(density + 2 * error, 2),
            color=look,
            alpha=0.25,
            lw=0,
        )
        how: dict[str, Any] = {"color": look, "ls": style(view, one), "label": one.label}
        axes.stairs(density, start + edges, baseline=None, lw=1.4, zorder=3, **how)
    axes.set_title(
        f"Free paths: {len(watched[0].outcomes):,} walks each, weighted, ± 2 standard errors",
        loc="left",
        fontsize=11,
    )
    axes.set_ylim(0, HEADROOM * max(exact.max(), 1e-30))
    axes.set_ylabel("density (1/length)")
    axes.legend(fontsize=9, edgecolor="none", framealpha=0.85, loc="upper right", ncols=4)


def _weights(axes: Axes, view: WatchedRay, watched: list[Watched]) -> None:
    """The weight of each walk that is shown, from its start to its collision."""
    start, length, channel = view.place.distance, view.place.length, view.channel
    plain = []
    for one in watched:
        values = [value[channel] for walk in one.walks for _, value in walk.weights]
        values += [walk.value[channel] for walk in one.walks]
        if np.allclose(values, 1.0, atol=1e-5):  # but for rounding
            plain.append(one.label)
            continue
        look = colour(view, one)
        for number, walk in enumerate(one.walks):
            t = [0.0] + [t for t, _ in walk.weights]
            w = [1.0] + [value[channel] for _, value in walk.weights]
            if walk.end is None:
                t, w = [*t, length], [*w, walk.value[channel]]
            axes.plot(
                start + np.array(t),
                w,
                drawstyle="steps-post",
                color=look,
                ls=style(view, one),
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


def _transmittance(axes: Axes, view: WatchedRay, watched: list[Watched]) -> None:
    """Exact transmittance, that of control and residual, and the running estimates of walks."""
    start, edges, channel = view.place.distance, view.edges, view.channel
    exact = view.transmittance[channel]
    for one in watched:
        look = colour(view, one)
        mean, error = one.transmitted(channel)
        for number, walk in enumerate(one.walks):
            if one.name not in ("ratio", "residual-ratio", "delta"):
                break  # nothing is known before its end
            label = None if number else f"{one.label}, {len(one.walks)} walks"
            running = one.running_estimate(walk, edges, channel)
            how: dict[str, Any] = {"color": look, "ls": style(view, one), "label": label}
            axes.plot(start + edges, running, lw=1.0, alpha=0.75, **how)
        axes.errorbar(
            [start + view.window[1]],
            [mean],
            [2 * error],
            fmt="s",
            color=look,
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
    label = f"exact T: {view.exact} at the end"
    axes.plot(start + edges, exact, color=BLACK, lw=2.2, label=label, zorder=4)
    axes.set_title("Transmittance from the medium's entry", loc="left", fontsize=11)
    axes.set_ylabel("transmittance")
    low, high = axes.get_ylim()
    axes.set_ylim(max(min(low, 0.0), -1.0), 1.6 * min(high, 2.0))
    axes.legend(fontsize=9, edgecolor="none", framealpha=0.85, loc="upper right", ncols=2)
