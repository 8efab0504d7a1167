"""Where the time of a render went: kernel by kernel, copies, and the host; and when, as a trace.

A trace is in the format of trace events, which Perfetto (https://ui.perfetto.dev) and chrome://tracing show:
https://docs.google.com/document/d/1CvAClvFfyA5R-PhYUmn5OOQtYMH4h6I0nSsKchNAySU
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from clvol.base.output_files import check_file, output_suffix, write_file

if TYPE_CHECKING:
    from clvol.base.output_files import StrPath

RENDER = "render"
"""The step of the host that is profiled; other steps are set-up, and what comes after."""
ACCUMULATE = "accumulate"
"""The kernel that is no stage: it adds finished samples to the film."""
_HOST, _DEVICE = 1, 2


def check_trace(path: StrPath) -> None:
    """Raise OptionError now for what `Profile.save_trace` would refuse after a long render."""
    output_suffix(path, (".json",))
    check_file(path)


@dataclass
class KernelProfile:
    """All launches of one kernel.

    Parameters
    ----------
    seconds : from start to end of each launch, by the device's clock.
    items : paths that it handled; samples that accumulate added to the film.
    item_bytes : of a path's state and queues that it reads and writes for each, at most.  Volumes, majorants
        and tables come on top.
    """

    seconds: float = 0.0
    launches: int = 0
    items: int = 0
    item_bytes: int = 0

    @property
    def nanoseconds(self) -> float | None:
        """Of each item, on the mean; None where there were none."""
        return 1e9 * self.seconds / self.items if self.items else None


@dataclass
class CopyProfile:
    """All copies between host and device, by the device's clock."""

    seconds: float = 0.0
    copies: int = 0
    bytes: int = 0


@dataclass(frozen=True)
class Span:
    """Something that took time: nanoseconds from the profile's beginning on, and what to say about it."""

    name: str
    start: int
    end: int
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Profile:
    """Where the time of a render went (``clvol.render(..., profile=True)``).

    Parameters
    ----------
    kernels : stages in their order, then accumulate.
    copied : all copies together.
    seconds, cpu_seconds : of the render: what passed, and what all threads of the process worked.
    host, device : what happened there.  The device's are launches and copies.
    in_flight : nanoseconds, and paths in flight then, at the beginning of every wave.
    lanes_busy : share of the lanes' steps that had a path, where walks go many at once; else None.
    left_out : launches and copies that are in the sums but not in `device`, as they were too many.
    about : of the render, as its metadata.
    """

    kernels: dict[str, KernelProfile]
    copied: CopyProfile
    seconds: float
    cpu_seconds: float
    host: list[Span] = field(repr=False)
    device: list[Span] = field(repr=False)
    in_flight: list[tuple[int, int]] = field(repr=False)
    lanes_busy: float | None = None
    left_out: int = 0
    about: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def stage_seconds(self) -> float:
        """In the kernels of the stages."""
        return sum(kernel.seconds for name, kernel in self.kernels.items() if name != ACCUMULATE)

    @property
    def outside(self) -> float:
        """Share of the render outside of the stages' kernels: what the wavefront costs."""
        return 1 - self.stage_seconds / self.seconds if self.seconds else 0.0

    @property
    def steps(self) -> dict[str, float]:
        """Seconds of the host's steps before and after the render."""
        [render] = (span for span in self.host if span.name == RENDER)
        apart = (span for span in self.host if span.end <= render.start or render.end <= span.start)
        return {span.name: 1e-9 * (span.end - span.start) for span in apart}

    @property
    def host_seconds(self) -> float:
        """Neither kernels nor copies: launching, waiting, and whatever else the host does meanwhile."""
        device = self.stage_seconds + self.kernels[ACCUMULATE].seconds + self.copied.seconds
        return max(self.seconds - device, 0.0)

    def save_trace(self, path: StrPath) -> None:
        """Write the trace as a .json; OptionError where that fails."""
        check_trace(path)
        write_file(path, json.dumps(self.trace()).encode())

    def trace(self) -> dict[str, Any]:
        """Trace events: two processes, host and device, and the number of paths in flight."""
        named = [
            {"ph": "M", "name": "process_name", "pid": pid, "args": {"name": name}}
            for pid, name in ((_HOST, "host"), (_DEVICE, "device"))
        ]
        flight = [
            {"ph": "C", "name": "paths in flight", "pid": _DEVICE, "ts": time / 1e3, "args": {"paths": paths}}
            for time, paths in self.in_flight
        ]
        spans = [*_complete(self.host, _HOST), *_complete(self.device, _DEVICE)]
        about = self.about | {"launches and copies left out": self.left_out}
        return {"traceEvents": [*named, *spans, *flight], "displayTimeUnit": "ms", "otherData": about}


def _complete(spans: list[Span], pid: int) -> list[dict[str, Any]]:
    """Complete events, whose times are microseconds."""
    return [
        {
            "ph": "X",
            "name": span.name,
            "pid": pid,
            "tid": 1,
            "ts": span.start / 1e3,
            "dur": (span.end - span.start) / 1e3,
            "args": span.about,
        }
        for span in spans
    ]
