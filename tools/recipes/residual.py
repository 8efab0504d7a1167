"""Ratio against residual ratio tracking (Novák et al. 2014), along a ray through more or less even smoke.

The claim: with a control that is near the density little is left to estimate.  The relative variance of an
estimate of the transmittance is

    exp(∫ (sigma_t - sigma_c)² / rate) - 1,

with the control sigma_c and the rate of tentative collisions of each cell; ratio tracking has sigma_c = 0.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import clvol
from clvol.lab.colours import BLUE, GREEN, ORANGE, VERMILION
from recipes.drawing import EXACT, panels, save, table
from recipes.scenes import cube, noise

if TYPE_CHECKING:
    from pathlib import Path

    from clvol.lab.ray.walks import Watched
    from clvol.lab.ray.watched import WatchedRay

KINDS = {"ratio": VERMILION, "min": ORANGE, "mean": GREEN, "max": BLUE}
"""Ratio tracking, and residual ratio tracking with each control."""
UNEVEN = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Weight of the noise in the density; the rest is even."""
DEPTH = 2.0
"""Optical depth of the cube's mean density across."""


def run(output: Path, quick: bool) -> str:
    """Measure, draw, and return the table."""
    many, found = 1 << (12 if quick else 18), {}
    field = noise(24)
    for uneven in UNEVEN[::2] if quick else UNEVEN:
        scene = cube(1 - uneven + uneven * field / field.mean(), DEPTH, size=9, light="sun")
        for kind in KINDS:
            name, control = ("ratio", "mean") if kind == "ratio" else ("residual-ratio", kind)
            view = clvol.trace_ray(
                scene,
                *(4, 4),
                techniques=["delta"],
                transmittances=[name],
                majorant="grid",
                control=control,
                walks=1,
                many=many,
            )
            watched = view.watched[1]
            mean, error = watched.transmitted(0)
            lookups = watched.mean("lookups")
            found[kind, uneven] = (error / mean) ** 2 * many, exact(view, watched), lookups
    _draw(output, sorted({uneven for _, uneven in found}), found)
    heads = [
        "noise in the density",
        "estimator",
        "relative variance",
        "exact",
        "look-ups a walk",
        "variance × look-ups",
    ]
    rows = [
        [
            f"{uneven:g}",
            "`ratio`" if kind == "ratio" else f"`residual-ratio`, {kind}",
            *value,
            value[0] * value[2],
        ]
        for (kind, uneven), value in found.items()
    ]
    return table(heads, rows)


def exact(view: WatchedRay, watched: Watched) -> float:
    """The relative variance by the midpoint rule along the ray."""
    middles = (view.edges[1:] + view.edges[:-1]) / 2
    cell = np.minimum(np.searchsorted(watched.cells["t_end"], middles), len(watched.cells) - 1)
    control, rate = watched.control(0), watched.rate()[cell]
    away = view.sigma_t[0] - (0.0 if control is None else control[cell])
    integrand = np.divide(away**2, rate, out=np.zeros_like(away), where=rate > 0)
    return float(np.expm1(integrand.sum() * view.place.length / len(middles)))


def _draw(output: Path, places: list[float], found: dict) -> None:
    figure, (left, right) = panels(2)
    for kind, colour in KINDS.items():
        label = "ratio" if kind == "ratio" else f"residual ratio, control {kind}"
        variance, theory, lookups = np.array([found[kind, place] for place in places]).T
        left.plot(places, theory, **{**EXACT, "color": colour}, label="exact" if kind == "ratio" else None)
        left.plot(places, variance, "o", color=colour, label=label)
        right.plot(places, lookups, "o-", color=colour, label=label)
    left.set(ylabel="relative variance of a walk's transmittance", ylim=(-1e-3, 10))
    left.set_yscale("symlog", linthresh=1e-2)
    right.set(ylabel="look-ups a walk", ylim=(0, None))
    left.set_title("Variance")
    right.set_title("What a walk costs")
    for axes in (left, right):
        axes.set_xlabel("weight of the noise in the density")
    save(figure, output)
