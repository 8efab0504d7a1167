"""Watches a render: every launch and copy by the device's clock, and the steps of the host.

Only a render that is to be profiled has a profiler.  It costs one copy a wave, of the queues' counters, from
which it learns how many paths each launch handled.
"""

from __future__ import annotations

import time
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.picture.profile import ACCUMULATE, RENDER, CopyProfile, KernelProfile, Profile, Span

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from contextlib import AbstractContextManager

    from clvol.device.device import Device
    from clvol.picture.result import Result
    from clvol.planning.plan import Plan

MOST_SPANS = 1 << 20
"""Launches and copies that a trace has at most; it says how many more there were."""
_TRIES = 16
"""Copies by which the device's clock is compared with the host's."""
_WORD = 4
_PLACE = {stage.name: place for place, stage in enumerate(layout.STAGES)}


class Snapshot(NamedTuple):
    """The queues' counters, once they are copied; uint32 (groups, QUEUE_LENGTHS_STRIDE)."""

    copy: cl.Event
    counters: np.ndarray


def timed(profiler: Profiler | None, name: str) -> AbstractContextManager[None]:
    """A step of the host, which a profiler is told of if there is one."""
    return profiler.step(name) if profiler else nullcontext()


class Profiler:
    """What one render has been seen to do; it is attached once there are a device and a plan."""

    def __init__(self) -> None:
        self.begun = time.perf_counter_ns()
        self.host: list[Span] = []
        self.device_spans: list[Span] = []
        self.in_flight: list[tuple[int, int]] = []
        self.left_out = 0
        self._cpu = 0.0

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """A step of the host; steps may lie within each other."""
        start, cpu = time.perf_counter_ns(), time.process_time()
        try:
            yield
        finally:
            if name == RENDER:
                self._cpu = time.process_time() - cpu
            if len(self.host) < MOST_SPANS:
                self.host.append(Span(name, start - self.begun, time.perf_counter_ns() - self.begun))

    def attach(self, device: Device, plan: Plan) -> None:
        """Watch this device, and forget what was added up."""
        self.device, self.plan = device, plan
        self._offset = _clock_offset(device) - self.begun
        self.forget()

    def forget(self) -> None:
        """Add up from zero; the trace goes on."""
        macros = self.plan.macros
        self.copied_in_all = CopyProfile()
        self.kernels = {
            name: KernelProfile(item_bytes=layout.state_traffic(macros, layout.stage(name)) + 2 * _WORD)
            for name in self.plan.stages
        }
        of_path = layout.counts_per_path(macros) + len(layout.first_hit_fields(macros))
        values = self.plan.channels + of_path * self.plan.jobs_per_sample
        self.kernels[ACCUMULATE] = KernelProfile(item_bytes=_WORD * values)

    def snapshot(self, counters: cl.Buffer) -> Snapshot:
        """Have the queues' counters read once what is queued has run."""
        words = np.empty(counters.size // _WORD, np.uint32)
        event = cl.enqueue_copy(self.device.queue, words, counters, is_blocking=False)
        return Snapshot(event, words.reshape(-1, layout.QUEUE_LENGTHS_STRIDE))

    def wave(
        self, stages: Sequence[str], launched: Sequence[cl.Event], earlier: Snapshot, later: Snapshot
    ) -> None:
        """Book a wave that has run, between two snapshots."""
        (copy, after), before = later, earlier.counters
        copy.wait()
        items = (after[:, layout.HANDLED] - before[:, layout.HANDLED]).sum(axis=0, dtype=np.int64)
        idle = int(before[:, len(layout.QUEUES)].sum())
        slots = len(before) * self.plan.tuning.group_slots
        self.in_flight.append((self._time(launched[0].profile.start), slots - idle))
        for stage, event in zip(stages, launched, strict=True):
            self.launched(stage, event, int(items[_PLACE[stage]]))
        self.copied(copy, after.nbytes)

    def launched(self, name: str, event: cl.Event, items: int) -> None:
        """Book a launch that has run."""
        kernel = self.kernels[name]
        kernel.seconds += self._span(name, event, {"items": items})
        kernel.launches += 1
        kernel.items += items

    def copied(self, event: cl.Event, size: int) -> None:
        """Book a copy that is through."""
        self.copied_in_all.seconds += self._span("copy", event, {"bytes": size})
        self.copied_in_all.copies += 1
        self.copied_in_all.bytes += size

    def profile(self, result: Result) -> Profile:
        """What came of it, for the render of this result."""
        [render] = (span for span in self.host if span.name == RENDER)
        return Profile(
            self.kernels,
            self.copied_in_all,
            1e-9 * (render.end - render.start),
            self._cpu,
            self.host,
            self.device_spans,
            self.in_flight,
            busy_lanes(result.stats),
            self.left_out,
            {name: value for name, value in result.metadata.items() if isinstance(value, str | int | float)},
        )

    def _span(self, name: str, event: cl.Event, about: dict[str, int]) -> float:
        """Seconds of a command that has run."""
        start, end = event.profile.start, event.profile.end
        if len(self.device_spans) < MOST_SPANS:
            self.device_spans.append(Span(name, self._time(start), self._time(end), about))
        else:
            self.left_out += 1
        return 1e-9 * (end - start)

    def _time(self, nanoseconds: int) -> int:
        return nanoseconds + self._offset


def busy_lanes(stats: Mapping[str, Any]) -> float | None:
    """Share of the lanes' steps that had a path; None where no walk goes by lanes."""
    steps = stats.get("lane_steps", 0)
    return stats["busy_lane_steps"] / steps if steps else None


def _clock_offset(device: Device) -> int:
    """What to add to the device's nanoseconds for the host's.

    A copy is queued after the host asks for it, and through before the host goes on: the closest of both
    bounds, of several copies, and their middle.
    """
    words, low, high = np.zeros(1, np.uint32), [], []
    buffer = device.memory.allocate(words.nbytes, "a profile", "do not profile")
    for _ in range(_TRIES):
        before = time.perf_counter_ns()
        event = cl.enqueue_copy(device.queue, buffer, words, is_blocking=True)
        after = time.perf_counter_ns()
        low.append(before - event.profile.queued)
        high.append(after - event.profile.end)
    return (max(low) + min(high)) // 2
