"""Kernels of small renders are built without optimisation: in half the time, and with the same bits.

A compiler may reorder no operation on floats here (`clvol.device.programs.BUILD_OPTIONS`), so that its
optimisations change how long a kernel takes, and nothing else.  Where a render turns out longer than it
looked, it goes on with optimised kernels.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from clvol.base.interrupts import renew
from clvol.device.programs import build_stages
from clvol.device.side_builds import SideBuilds, in_cache

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyopencl as cl

    from clvol.device.device import Device
    from clvol.device.side_builds import Unit

log = logging.getLogger("clvol")
OPTION = "-cl-opt-disable"
SAMPLES = 1 << 15
"""Samples of a program, in this process, up to which optimising it is not worth the while."""
SECONDS = 1.0
"""Of a render in quick kernels, after which they are replaced by optimised ones."""


@dataclass(eq=False)
class StageUnits:
    """What of each stage is built `now`, and `optimised` in its place, once that pays; empty if it is."""

    device: Device
    now: Mapping[str, Unit]
    optimised: Mapping[str, Unit]

    @classmethod
    def of(cls, device: Device, units: Mapping[str, Unit], samples: int | None) -> StageUnits:
        """Stages' programs for `samples` of all pixels together; None: for who knows how many.

        PoCL alone is known to build the same arithmetic either way.  What it has optimised before stays so.
        """
        if samples is None or not device.is_pocl:
            return cls(device, units, {})
        there = in_cache(device, units.values())
        small = {
            name: replace(unit, options=(*unit.options, OPTION))
            for name, unit in units.items()
            if unit not in there and device.samples.get(unit.source, 0) + samples <= SAMPLES
        }
        for unit in small.values():
            device.samples[unit.source] = device.samples.get(unit.source, 0) + samples
        return cls(device, {**units, **small}, units if small else {})

    def when_slow(self, seconds: float) -> dict[str, cl.Kernel]:
        """Optimised kernels in place of quick ones that have run so long, once; else none."""
        if not self.optimised or seconds < SECONDS:
            return {}
        units, self.optimised = self.optimised, {}
        log.info("the render takes its time: its kernels are built anew, optimised")
        with SideBuilds(self.device, units.values()) as builds:
            kernels = build_stages(self.device, units)
            builds.remember()
        renew()  # the compiler takes signals to itself
        return kernels
