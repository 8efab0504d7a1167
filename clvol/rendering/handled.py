"""How many paths every stage has handled, by the counters that each group keeps with its queues."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clvol import layout

if TYPE_CHECKING:
    from collections.abc import Mapping


class Handled:
    """Sums of counters that begin anew after 2³², and are read before they can have come so far."""

    def __init__(self, groups: int) -> None:
        self._read = np.zeros((groups, len(layout.QUEUES)), np.uint32)
        self.clear()

    def clear(self) -> None:
        """Count from zero; the device's counters go on."""
        self._total = np.zeros(len(layout.QUEUES), np.uint64)

    def add(self, counters: np.ndarray) -> None:
        """What has been handled since the last time: uint32 (groups, QUEUE_LENGTHS_STRIDE)."""
        read = counters[:, layout.HANDLED].copy()
        self._total += (read - self._read).sum(axis=0, dtype=np.uint64)
        self._read = read

    def all_idle(self, group_slots: int) -> np.ndarray:
        """Counters of groups whose slots hold no path."""
        counters = np.zeros((len(self._read), layout.QUEUE_LENGTHS_STRIDE), np.uint32)
        counters[:, len(layout.QUEUES)] = group_slots
        counters[:, layout.HANDLED] = self._read
        return counters

    def by_stage(self, stages: tuple[str, ...]) -> dict[str, int]:
        """Paths that each of these stages has handled."""
        handled = {s.name: int(n) for s, n in zip(layout.STAGES, self._total, strict=True)}
        return {stage: handled[stage] for stage in stages}

    def take_up(self, by_stage: Mapping[str, int]) -> None:
        """Go on from what had been handled, by stage."""
        self._total = np.array([by_stage.get(s.name, 0) for s in layout.STAGES], np.uint64)
