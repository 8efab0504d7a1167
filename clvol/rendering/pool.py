"""How many paths a render has in flight, and how their samples are dealt out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clvol.base.arguments import whole
from clvol.errors import OptionError

if TYPE_CHECKING:
    from clvol.device.device import Device
    from clvol.planning.plan import Plan

_LEAST_PASSES = 4
"""In flight together, however many jobs they hold."""


@dataclass(frozen=True)
class Pool:
    """How many paths are in flight, how many jobs a pass holds (at least one sample per pixel), and the ring.

    On a processor more slots take as long or longer, and fewer take more waves, each with its launches.
    """

    slots: int
    pass_jobs: int
    ring_jobs: int

    @classmethod
    def for_device(cls, device: Device, plan: Plan, slots: int | None = None) -> Pool:
        """Pool for a device; `slots` is rounded up to whole groups."""
        if slots is None:
            slots = 1 << 15 if device.is_cpu else 1 << 20
        slots = whole("pool", slots)
        if not 1 <= slots <= 1 << 26:
            raise OptionError(f"a pool of {slots} paths", hint="give 1 to 67108864")
        groups = max(1, -(-slots // plan.tuning.group_slots))
        slots = groups * plan.tuning.group_slots
        return cls(slots, pass_jobs=4 * slots, ring_jobs=32 * slots)

    def ring(self, sample_jobs: int) -> tuple[int, int]:
        """Passes in flight together, and the jobs that they hold at most; `sample_jobs`: of a sample of all.

        Of fewer pixels a pass may hold more jobs than of all, though not more than this.
        """
        most_jobs = max(self.pass_jobs, sample_jobs)
        passes = max(_LEAST_PASSES, self.ring_jobs // most_jobs)
        return passes, most_jobs * passes
