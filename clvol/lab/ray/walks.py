"""Recorded walks along one ray, and what they estimate.  Pure NumPy."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from clvol.lab.digits import up_to_error, with_error

TENTATIVE, LOOKUP, NULL, REAL, ESTIMATE = range(5)
"""Kinds of events, as cl/ray/recorder.h numbers them."""
OUTCOME = np.dtype(
    [
        ("t", "f4"),  # of the real collision; -1 where it left the medium
        ("value", "f4", 3),  # weight of a technique's walk, or estimate of transmittance, by channel
        ("tentative", "f4"),
        ("real", "f4"),
        ("lookups", "f4"),
        ("flaws", "f4"),  # violations of the bound, and whether it was given up
        ("events", "f4"),
    ]
)
"""A walk's outcome, as cl/ray/walks.cl writes it; numbers but for t and value are counts."""
CELL = np.dtype(
    [
        ("t", "f4"),
        ("t_end", "f4"),
        ("majorant", "f4"),
        ("control", "f4", 3),
        ("residual_control", "f4", 3),
        ("residual_rate", "f4"),
    ]
)
"""A cell of the majorant along the ray, as cl/ray/tables.cl writes it; nan for what the walk does not use."""
ROUNDING = 1e-5
"""Relative error of what walks carry in float32 through many collisions."""
UNNAMED = "the medium"
"""What a medium without a name is called."""


def format_estimate(mean: float, error: float) -> str:
    """An estimate with its standard error; without where every walk gave the same, but for rounding."""
    if error > ROUNDING * abs(mean):
        return with_error(mean, error)
    return f"{up_to_error(mean, ROUNDING * abs(mean))} from every walk"


@dataclass
class Collision:
    """One collision of a walk.

    t : distance from the medium's entry.  rate : of tentative collisions there, nan for techniques without.
    sigma_t : what was looked up, a number per channel; None where nothing was.
    kind : "null", "real", or "control": real without a look-up.
    """

    t: float
    rate: float = math.nan
    sigma_t: tuple[float, ...] | None = None
    kind: str = "null"


@dataclass
class Walk:
    """One walk, event by event; t counts from the medium's entry.

    end : t of its real collision, or None where it left the medium.
    value : its final weight, or its estimate of transmittance, by channel.
    lookups : t of each look-up.  weights, estimates : (t, value by channel) wherever they changed.
    truncated : it had more events than were recorded.
    """

    end: float | None
    value: tuple[float, ...]
    collisions: list[Collision] = field(default_factory=list)
    lookups: list[float] = field(default_factory=list)
    weights: list[tuple[float, tuple[float, ...]]] = field(default_factory=list)
    estimates: list[tuple[float, tuple[float, ...]]] = field(default_factory=list)
    truncated: bool = False

    def reach(self, channel: int) -> float | None:
        """How far it went: to a real collision, or to where its estimate became 0; None for all the way."""
        if self.end is not None:
            return self.end
        if self.value[channel] == 0.0 and self.collisions:
            return self.collisions[-1].t
        return None


def read_walk(outcome: np.void | np.ndarray, events: np.ndarray) -> Walk:
    """A walk from its `OUTCOME` and its log, float32 (n, 5), as cl/ray/walks.cl writes them."""
    t, value = float(outcome["t"]), tuple(outcome["value"].tolist())
    walk = Walk(t if t >= 0 else None, value, truncated=bool(len(events) < outcome["events"]))
    open_collision: Collision | None = None
    for kind, t, *numbers in events.tolist():
        numbers = tuple(numbers)
        if kind == TENTATIVE:
            open_collision = Collision(t, numbers[0])
            walk.collisions.append(open_collision)
        elif kind == LOOKUP:
            walk.lookups.append(t)
            if open_collision:
                open_collision.sigma_t = numbers
        elif kind == NULL:
            walk.weights.append((t if open_collision is None else open_collision.t, numbers))
        elif kind == REAL:
            if open_collision is None:  # found without tentative collisions
                walk.collisions.append(Collision(t, kind="real"))
            else:
                open_collision.kind = "control" if open_collision.sigma_t is None else "real"
            walk.weights.append((t, numbers))
        else:
            walk.estimates.append((t, numbers))
    if outcome["real"] > 0 and walk.end is None and walk.collisions:
        walk.collisions[-1].kind = "real"  # ends an all-or-nothing estimate
    return walk


@dataclass(frozen=True, eq=False)
class Watched:
    """One technique or transmittance on the ray.

    family, name : of `clvol.planning.registry`; the name "analytic" stands for the closed forms of
        homogeneous media.
    cells : `CELL` (n,) of the majorant it walks; None where it walks none.
    outcomes : `OUTCOME` (walks,).
    walks : the first of them, event by event.
    """

    family: str
    name: str
    majorant: str
    biased: bool
    cells: np.ndarray | None
    outcomes: np.ndarray
    walks: list[Walk]

    @property
    def label(self) -> str:
        """Its name, and that it is biased where it is."""
        return f"{self.name} (biased)" if self.biased else self.name

    def mean(self, count: str) -> float:
        """Mean over the walks of one of the counts of `OUTCOME`."""
        return float(self.outcomes[count].mean(dtype=np.float64))

    def per_walk(self, count: str) -> str:
        """The same with its standard error, in words."""
        values = self.outcomes[count].astype(np.float64)
        error = values.std(ddof=1) / math.sqrt(len(values))
        return with_error(values.mean(), error) if error > 0 else f"{values.mean():g}"

    def control(self, channel: int) -> np.ndarray | None:
        """What it subtracts in each cell, (n,), or None."""
        if self.cells is None:
            return None
        name = "residual_control" if self.family == "transmittance" else "control"
        values = self.cells[name][:, channel].astype(np.float64)
        return None if np.isnan(values).all() else values

    def rate(self) -> np.ndarray | None:
        """Rate of its tentative collisions in each cell, (n,), or None where it has none."""
        if self.cells is None or self.name == "regular":
            return None
        rate = self.cells["residual_rate"].astype(np.float64)
        return self.cells["majorant"].astype(np.float64) if np.isnan(rate).all() else rate

    def transmitted(self, channel: int) -> tuple[float, float]:
        """Its estimate of the part's transmittance and its standard error: means, or weights that left."""
        values = self.outcomes["value"][:, channel].astype(np.float64)
        if self.family == "technique":
            values = np.where(self.outcomes["t"] < 0, values, 0.0)
        return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values)))

    def free_path_density(self, edges: np.ndarray, channel: int) -> tuple[np.ndarray, np.ndarray]:
        """Density of free paths between `edges`, weighted, and its standard error, float64 (bins,)."""
        count, bins = len(self.outcomes), len(edges) - 1
        t = self.outcomes["t"].astype(np.float64)
        hit = (t >= edges[0]) & (t <= edges[-1])  # those that go further count as walks, not as collisions
        weights = self.outcomes["value"][hit, channel].astype(np.float64)
        place = np.minimum(np.searchsorted(edges, t[hit], side="right") - 1, bins - 1)
        mean = np.bincount(place, weights, bins) / count
        square = np.bincount(place, weights**2, bins) / count
        error = np.sqrt(np.maximum(square - mean**2, 0.0) / count)
        return mean / np.diff(edges), error / np.diff(edges)

    def control_depth(self, edges: np.ndarray, channel: int) -> np.ndarray:
        """Optical depth of the control from the entry to each of `edges`; 0 where there is none."""
        control = self.control(channel)
        if control is None or self.cells is None:
            return np.zeros_like(edges)
        starts, ends = (self.cells[name].astype(np.float64) for name in ("t", "t_end"))
        depth = np.concatenate([[0.0], np.cumsum(control * (ends - starts))])
        ends = np.concatenate([[0.0], ends])
        interpolated: np.ndarray = np.interp(edges, ends, depth)
        return interpolated

    def running_estimate(self, walk: Walk, edges: np.ndarray, channel: int) -> np.ndarray:
        """What a walk's estimate of transmittance would be if the medium ended at each of `edges`."""
        steps = [(0.0, 1.0)] + [(t, value[channel]) for t, value in walk.estimates]
        if walk.value[channel] == 0.0 and steps[-1][1] != 0.0:  # lost at its last collision
            last = walk.collisions[-1].t if walk.collisions else 0.0
            steps.append((max(last, steps[-1][0]), 0.0))
        at = np.array([t for t, _ in steps])
        values = np.array([value for _, value in steps])
        number = np.searchsorted(at, edges, side="right") - 1
        since = self.control_depth(edges, channel) - self.control_depth(at, channel)[number]
        estimate: np.ndarray = values[number] * np.exp(-since)
        return estimate
