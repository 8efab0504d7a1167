"""How spectral tracking chooses events: max, average, history (Kutz et al. 2017, section 5).

The claim: probabilities that only look at the coefficients let the weights of thin channels grow with each
null collision, and with them the variance; those that look at the path's history keep weights bounded.  A
slab that attenuates red most shows it exactly: along it the second moment of a channel's weight grows as

    exp(∫ sigma_n² / (sigma_maj P_null) - sigma_maj + 2 sigma_t)    relative to T²,

with P_null of the rule; with the history it is at most 3, the number of channels, over T.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import clvol
from clvol.lab.colours import BLUE, GREEN, VERMILION
from recipes.drawing import EXACT, panels, save, table
from recipes.measuring import costs
from recipes.scenes import cube, noise

if TYPE_CHECKING:
    from pathlib import Path

RULES = {"max": VERMILION, "average": BLUE, "history": GREEN}
COLOURS = np.array([1.0, 0.5, 0.1])
"""Extinction of red, green and blue over that of red."""
DEPTHS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
PICTURED = (2.0, 8.0)
"""Optical depths of red across the cubes that are rendered."""
ALBEDO = 0.9


def run(output: Path, quick: bool) -> str:
    """Measure, draw, and return the table."""
    many = 1 << (14 if quick else 20)
    depths = DEPTHS[:2] if quick else DEPTHS
    walks = {(rule, depth): _slab(rule, depth, many) for rule in RULES for depth in depths}
    size, spp, rounds = (8, 4, 4) if quick else (48, 16, 6)
    combinations = {"delta": {"technique": "delta"}}
    combinations |= {rule: {"technique": "spectral", "probability": rule} for rule in RULES}
    rows, measured = [], {}
    for depth in PICTURED[:1] if quick else PICTURED:
        density = noise(24)[..., None] * COLOURS.astype(np.float32)
        found = costs(cube(density, depth, albedo=ALBEDO, size=size), combinations, spp, rounds)
        bar = found["delta"]
        for name, cost in found.items():
            by_lookups = cost.variance * cost.per_sample["lookups"]
            by_lookups /= bar.variance * bar.per_sample["lookups"]
            by_time = cost.variance / bar.variance * cost.times_slower(bar)
            measured[name, depth] = by_lookups
            row = (
                cost.per_sample["lookups"],
                cost.variance / bar.variance,
                by_lookups,
                by_time,
                cost.largest_weight,
            )
            rows.append([f"{depth:g}", f"`{name}`", *row])
    _draw(output, depths, walks, measured)
    heads = (
        "red's optical depth",
        "",
        "look-ups a sample",
        "variance",
        "× look-ups",
        "× CPU time",
        "largest weight",
    )
    return table(heads, rows)


def _slab(rule: str, depth: float, many: int) -> float:
    """Relative variance of blue's transmittance along one ray through a slab of even density."""
    even = np.ones((2, 2, 2, 1), np.float32) * COLOURS.astype(np.float32)
    view = clvol.trace_ray(
        cube(even, depth, albedo=ALBEDO, size=9),
        *(4, 4),
        techniques=["spectral"],
        transmittances=[],
        channel=2,
        majorant="global",
        probability=rule,
        walks=1,
        many=many,
    )
    mean, error = view.watched[0].transmitted(2)
    return (error / mean) ** 2 * many


def exact(rule: str, depth: np.ndarray) -> np.ndarray:
    """The same in closed form; for the history the bound."""
    sigma_t = COLOURS * depth[:, None]
    sigma_n, majorant = depth[:, None] - sigma_t, depth
    if rule == "history":
        return len(COLOURS) / np.exp(-sigma_t[:, 2]) - 1
    mean = np.max if rule == "max" else np.mean
    events = [mean(sigma, axis=1) for sigma in (sigma_t * ALBEDO, sigma_t * (1 - ALBEDO), sigma_n)]
    null = events[2] / sum(events)
    return np.exp(sigma_n[:, 2] ** 2 / (majorant * null) - majorant + 2 * sigma_t[:, 2]) - 1


def _draw(output: Path, depths: tuple[float, ...], walks: dict, measured: dict) -> None:
    figure, (left, right) = panels(2)
    line = np.geomspace(depths[0], depths[-1], 60)
    for rule, colour in RULES.items():
        how = {**EXACT, "color": colour}
        left.plot(
            line, exact(rule, line), label=f"{rule}: {'bound' if rule == 'history' else 'exact'}", **how
        )
        points = [walks[rule, depth] for depth in depths]
        left.plot(depths, points, "o", color=colour, ms=5, label=f"{rule}: measured")
    left.set(yscale="log", xlabel="optical depth of red", ylabel="relative variance of blue's transmittance")
    left.set_title("One ray through an even slab")
    pictured = sorted({depth for _, depth in measured})
    for n, (name, colour) in enumerate({"delta": "#888888", **RULES}.items()):
        places = np.arange(len(pictured)) + 0.2 * (n - 1.5)
        values = [measured[name, depth] for depth in pictured]
        right.bar(
            places, values, 0.18, color=colour, label="delta, a path for each channel" if n == 0 else name
        )
    right.set_xticks(range(len(pictured)), [f"{depth:g}" for depth in pictured])
    right.axhline(1.0, **EXACT)
    right.set(xlabel="optical depth of red", ylabel="variance × look-ups, over delta's")
    right.set_title("A picture of a cube of smoke")
    save(figure, output)
