"""Orders on what renders them: one device, several, or a cluster."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from clvol.base.progress import Glance, Progress
from clvol.cluster.dask import DaskWorkers
from clvol.cluster.devices import DeviceWorkers
from clvol.cluster.job import Job
from clvol.cluster.spread import Spread
from clvol.device.device import open_devices
from clvol.picture.merging import merge
from clvol.rendering.session import MAX_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from clvol.api.order import Opened, Order
    from clvol.base.progress import ProgressCallback
    from clvol.picture.result import Result
    from clvol.rendering.profiler import Profiler


@dataclass(eq=False)
class SpreadOrder:
    """An order whose ranges are with several workers; what `clvol.api.order.Opened` is on one device."""

    order: Order
    spread: Spread[Any]

    def steps(self, callback: ProgressCallback | None, urgency: Callable[[], int]) -> Iterator[int]:
        """Render, and stop wherever the picture has more samples: at how many of each pixel."""
        order, spread = self.order, self.spread
        had = 0 if order.resumed is None else order.resumed.samples[1]
        total = had + order.count if order.first + order.count < MAX_SAMPLES else None
        for done in spread.steps(order.time_limit, urgency):
            if callback is not None:
                with Glance(self._so_far, callback) as glance:
                    so_far = had + done, total, spread.seconds, order.time_limit
                    callback(Progress(*so_far, glance=glance))
            yield done

    def result(self, done: int, final: bool = True) -> Result:
        """The picture so far, and those that it goes on from."""
        while (result := self.spread.result(final)) is None:
            self.spread.find_lost()
            for _ in self.spread.steps(None, lambda: 0):
                pass
        return self._whole(result)

    def _so_far(self) -> Result | None:
        """The picture so far; None where a worker has just lost a part of it."""
        result = self.spread.result(final=False)
        return None if result is None else self._whole(result)

    def _whole(self, result: Result) -> Result:
        order = self.order
        if order.resumed is not None:
            result = merge([order.resumed, result])
        return result.denoise() if order.denoise else result


@contextmanager
def opened(
    order: Order, callback: ProgressCallback | None, profiler: Profiler | None = None
) -> Iterator[Opened | SpreadOrder]:
    """An order on what is to render it, which it is gone from at the end; `callback` is told of a pilot."""
    if not order.spread:
        yield order.open(callback, profiler)
        return
    device = None if order.client is None else order.device
    spp = order.count if order.time_limit is None else None
    job = Job(order.scene, order.planned().choices, order.seed, order.asked, device, order.pool, spp)
    workers: Any
    if order.client is not None:
        workers = DaskWorkers(job, order.client)
    else:
        workers = DeviceWorkers(job, open_devices(order.device))
    try:
        yield SpreadOrder(order, Spread(workers, job, order.first, order.count))
    finally:
        workers.close()
