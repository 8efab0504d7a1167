"""What a sample of each combination costs and how much it varies: rounds by turns, CPU time, counts."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from clvol.device.device import open_device
from clvol.lab.statistics import round_variance
from clvol.lab.trials import Trial
from clvol.planning.choices import Choices

if TYPE_CHECKING:
    from collections.abc import Mapping

COUNTS = ("lookups", "cells_crossed")


@dataclass
class Cost:
    """Rounds of one combination.

    variance : of one sample of a pixel, the mean over pixels and channels.
    cpu : float64 (rounds,), seconds of the processor.  per_sample : counts of a sample, by name.
    largest_weight : of any path.
    """

    variance: float
    cpu: np.ndarray
    per_sample: dict[str, float] = field(default_factory=dict)
    largest_weight: float = 1.0

    def times_slower(self, other: Cost) -> float:
        """CPU time over another's, the median of rounds side by side: what disturbs both cancels."""
        return float(np.median(self.cpu / other.cpu))


def costs(
    scene: Any, combinations: Mapping[str, Mapping[str, str]], spp: int, rounds: int = 6
) -> dict[str, Cost]:
    """Measure combinations of choices by turns; each render has a seed of its own."""
    device = open_device(None)
    # background: walks of all techniques end at their collisions
    base = {"sampler": "independent", "lanes": "off", "background": "sampled"}
    trials = {
        label: Trial.open(device, scene, Choices().but(**{**base, **names}))
        for label, names in combinations.items()
    }
    images: dict[str, list[np.ndarray]] = {label: [] for label in trials}
    spent: dict[str, list[float]] = {label: [] for label in trials}
    stats: dict[str, list[dict[str, Any]]] = {label: [] for label in trials}
    for n, trial in enumerate(trials.values()):
        trial.render(10**6 + n, 1)  # the first pays for what later ones find done
    for turn in range(rounds):
        for n, (label, trial) in enumerate(trials.items()):
            started = time.process_time()
            result = trial.render(1000 * turn + n, spp)
            spent[label].append(time.process_time() - started)
            images[label].append(result.image)
            stats[label].append(result.stats)
    samples = rounds * spp * images[next(iter(images))][0][..., 0].size
    return {
        label: Cost(
            float(round_variance(np.stack(images[label])).mean()) * spp,
            np.array(spent[label]),
            {name: sum(s[name] for s in stats[label]) / samples for name in COUNTS},
            max(s["largest_weight"] for s in stats[label]),
        )
        for label in trials
    }
