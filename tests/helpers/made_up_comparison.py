"""Comparisons of trials that render nothing: pictures of known noise and bias, at a known pace."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from clvol.lab.comparison.combine import Lineup
from clvol.lab.comparison.figures import compute_figures
from clvol.lab.comparison.measure import Effort, measure
from clvol.lab.comparison.result import Comparison

SIZE = 16
"""Edge of the pictures in pixels."""


class MadeUp:
    """A trial that renders 1 + bias + noise of variance 1 / spp; a look-up a sample, a second for `rate`."""

    def __init__(self, rate: float = 1e3, bias: float = 0.0, sigma: float = 1.0, ctrl_c: int = 10**9):
        self.rate, self.bias, self.sigma, self.ctrl_c = rate, bias, sigma, ctrl_c
        self.biased, self.names, self.options = bias != 0, {"technique": "delta"}, "--technique delta"
        self.precompute_seconds, self.session = 0.5, SimpleNamespace(kernel_seconds=3.0)
        self.renders: list[tuple[int, int]] = []

    def render(self, seed: int, spp: int) -> SimpleNamespace:
        if len(self.renders) == self.ctrl_c:
            raise KeyboardInterrupt
        self.renders.append((seed, spp))
        noise = np.random.default_rng(seed).standard_normal((SIZE, SIZE, 3)) * self.sigma / np.sqrt(spp)
        seconds = {"render": spp / self.rate}
        return SimpleNamespace(
            image=(1 + self.bias + noise).astype(np.float32),
            stats={"seconds": seconds, "lookups": spp * SIZE**2},
            metadata={"seed": seed},
        )


def measured(trials: dict[str, MadeUp], effort: Effort) -> Comparison:
    """A comparison of made-up trials."""
    told: list[tuple[float, float, str]] = []
    found, reference, interrupted = measure(
        Lineup(trials), effort, None, MadeUp, lambda *record: told.append(record)
    )
    assert all(done <= total + 1e-6 for done, total, _ in told if total)
    labels = list(trials)
    figures = compute_figures(found, reference, labels[0])
    about = {"scene": "<i>x</i>", "rounds": len(found[0].seconds), "odd": float("nan")}
    return Comparison(figures, labels[0], reference, (), (), interrupted, about)
