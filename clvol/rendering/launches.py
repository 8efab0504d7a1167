"""What is queued on the device, and what it took: waves of all stages, and passes that are added to the film.

The device works off one queue in order.  The host looks in once a *batch* of waves, and the device does not
rest meanwhile: one wave more is queued behind what the host reads, and runs while it decides.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pyopencl as cl

from clvol.device.launch import launch

if TYPE_CHECKING:
    from collections.abc import Mapping

    from clvol.device.device import Device
    from clvol.planning.plan import Plan
    from clvol.rendering.profiler import Profiler, Snapshot

BATCH_SECONDS = 0.02
"""Waves are launched in batches of about this length; between batches the host reads the counters."""


class Wave(NamedTuple):
    """The launches of all stages, and for a profiler the queues before and after them."""

    launches: list[cl.Event]
    before: Snapshot | None = None
    after: Snapshot | None = None


class Launches:
    """The launches of one wavefront.

    Parameters
    ----------
    groups : of work-items, of a launch of a stage.
    buffers : with the `counters` that end a batch, and the `queue_lengths` that a profile is made of.
    profiler : is told of all that has run.

    Attributes
    ----------
    seconds : of what has run, by stage, `accumulate` included.
    launches, waves : how many have run.
    """

    def __init__(
        self,
        device: Device,
        plan: Plan,
        groups: int,
        buffers: Mapping[str, cl.Buffer],
        profiler: Profiler | None,
    ) -> None:
        self._device, self._plan, self._groups, self._buffers = device, plan, groups, buffers
        self._profiler = profiler
        self._waves: list[Wave] = []
        self._passes: list[tuple[cl.Event, int]] = []
        self.clear()

    def clear(self) -> None:
        """Count from zero."""
        self.seconds = dict.fromkeys((*self._plan.stages, "accumulate"), 0.0)
        self.launches = self.waves = 0
        if self._profiler:
            self._profiler.forget()

    def batch(
        self, kernels: Mapping[str, cl.Kernel], waves: int, ahead: bool
    ) -> tuple[int, float, np.ndarray]:
        """Run up to `waves` waves: how many, the seconds they took, and the counters they left.

        One wave is queued behind the one that runs, so that a batch that turns out long can be cut.

        ahead : leave one more wave queued, the first of the next batch, which runs while the host is busy.
        """
        start, queued = time.perf_counter(), self._waves
        run, seconds = 0, 0.0
        while run + len(queued) < waves:
            self._queue_wave(kernels)
            if len(queued) > 1:
                seconds += self._book_wave()
                run += 1
                if time.perf_counter() - start > 2 * BATCH_SECONDS:
                    break
        counters, read = self._counters()
        last = len(queued)
        if ahead:
            self._queue_wave(kernels)
        read.wait()
        seconds += sum(self._book_wave() for _ in range(last))
        self._book_passes()
        if self._profiler:
            self._profiler.copied(read, counters.nbytes)
        return run + last, seconds, counters

    def settle(self) -> None:
        """Wait for all that is queued, and book it."""
        while self._waves:
            self._book_wave()
        self._book_passes()

    def forget(self) -> None:
        """Book nothing of what is queued."""
        self._waves, self._passes = [], []

    def accumulate(self, kernel: cl.Kernel, pixels: int, samples: int) -> None:
        """Add a pass to the film, whose arguments the kernel has: so many samples of so many pixels."""
        self._passes.append((launch(self._device, kernel, pixels), samples * pixels))

    def _queue_wave(self, kernels: Mapping[str, cl.Kernel]) -> None:
        local, profiler, before, after = self._plan.tuning.local_size, self._profiler, None, None
        if profiler:
            before = (
                self._waves[-1].after if self._waves else profiler.snapshot(self._buffers["queue_lengths"])
            )
        launches = [
            launch(self._device, kernels[stage], self._groups * local, local) for stage in self._plan.stages
        ]
        if profiler:
            after = profiler.snapshot(self._buffers["queue_lengths"])
        self._waves.append(Wave(launches, before, after))

    def _counters(self) -> tuple[np.ndarray, cl.Event]:
        """What the counters are once what is queued has run."""
        buffer = self._buffers["counters"]
        counters = np.empty(buffer.size // 4, np.uint32)
        return counters, cl.enqueue_copy(self._device.queue, counters, buffer, is_blocking=False)

    def _book_wave(self) -> float:
        """Wait for the first wave that is queued, and count it: its seconds."""
        wave, stages = self._waves.pop(0), self._plan.stages
        wave.launches[-1].wait()
        self.waves += 1
        if self._profiler and wave.before and wave.after:
            self._profiler.wave(stages, wave.launches, wave.before, wave.after)
        return sum(self._took(stage, event) for stage, event in zip(stages, wave.launches, strict=True))

    def _book_passes(self) -> None:
        """Wait until the passes that are queued are in the film, and count them."""
        passes, self._passes = self._passes, []
        for event, items in passes:
            event.wait()
            self._took("accumulate", event)
            if self._profiler:
                self._profiler.launched("accumulate", event, items)

    def _took(self, name: str, event: cl.Event) -> float:
        """Count a launch that has run: its seconds."""
        seconds: float = 1e-9 * (event.profile.end - event.profile.start)
        self.seconds[name] += seconds
        self.launches += 1
        return seconds
