"""Orders on what renders them: one device, several, or a cluster."""

from __future__ import annotations

import logging
import math
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from clvol.base.progress import Glance, Progress
from clvol.cluster.dask import DaskWorkers
from clvol.cluster.devices import DeviceWorkers
from clvol.cluster.job import Job
from clvol.cluster.spread import Spread
from clvol.cluster.survey import Need, survey_seed
from clvol.device.device import names_several, open_device, open_devices
from clvol.picture.estimate import Replicates
from clvol.picture.merging import merge
from clvol.rendering.adaptive import LEAST
from clvol.rendering.doubts import say_missed_target
from clvol.rendering.session import MAX_SAMPLES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from clvol.api.order import Opened, Order
    from clvol.base.progress import ProgressCallback
    from clvol.cluster.workers import Workers
    from clvol.picture.result import Result
    from clvol.rendering.profiler import Profiler

log = logging.getLogger("clvol")


class SpreadOrder:
    """An order whose ranges are with several workers; what `clvol.api.order.Opened` is on one device."""

    def __init__(self, order: Order, workers: Workers[Any], job: Job) -> None:
        self.order, self._workers, self._job = order, workers, job
        self._spread: Spread[Any] | None = None
        self._surveyed = 0.0  # seconds
        self._survey: Result | None = None

    def steps(self, callback: ProgressCallback | None, urgency: Callable[[], int]) -> Iterator[int]:
        """Render, and stop wherever the picture has more samples: at how many of each pixel."""
        order, target = self.order, self.order.choices.target_error
        count, limit = order.count, order.time_limit
        if target is not None:
            count = self._look(target, callback, urgency)
            if urgency() and self._survey is not None:
                yield self._survey.samples[1]  # better than nothing
                return
            limit = None if limit is None else max(limit - self._surveyed, 0.0)
        told = target is not None
        self._spread = spread = Spread(self._workers, self._job, order.first, count, order.seed, told)
        had = 0 if order.resumed is None else order.resumed.samples[1]
        total = had + count if order.first + count < MAX_SAMPLES else None
        for done in spread.steps(limit, urgency):
            if callback is not None:
                with Glance(self._so_far, callback) as glance:
                    seconds = self._surveyed + spread.seconds
                    callback(Progress(had + done, total, seconds, order.time_limit, glance=glance))
            yield done

    def _look(self, target: float, callback: ProgressCallback | None, urgency: Callable[[], int]) -> int:
        """Render surveys: how many samples of a pixel the target error takes."""
        order, seed = self.order, survey_seed(self.order.seed)
        need = Need.of(target, order.spp, 0, math.nan, False)
        while need.survey and not urgency() and not self._is_late():
            had = 0 if self._survey is None else self._survey.samples[1]
            spread = Spread(self._workers, self._job, had, need.survey - had, seed, told=had > 0)
            for done in spread.steps(None, urgency):
                if callback is not None:
                    seconds = self._surveyed + spread.seconds
                    so_far = had + done, need.survey, seconds, order.time_limit
                    callback(Progress(*so_far, what="survey"))
            more = self._whole_of(spread, final=False)
            self._survey = more if self._survey is None else merge([self._survey, more])
            self._surveyed += spread.seconds
            replicates = isinstance(self._survey.estimate, Replicates)
            need = Need.of(target, order.spp, self._survey.samples[1], self._survey.noise, replicates)
        return max(need.picture, min(LEAST, order.spp or LEAST))

    def _is_late(self) -> bool:
        limit = self.order.time_limit
        return limit is not None and self._surveyed >= limit

    def result(self, done: int, final: bool = True) -> Result:
        """The picture so far, and those that it goes on from."""
        if self._spread is None:
            assert self._survey is not None
            return self._whole(self._survey)
        result = self._whole(self._whole_of(self._spread, final))
        target = self.order.choices.target_error
        if final and target is not None:
            spent = f"survey {self._survey.samples[1]}" if self._survey else "no survey"
            log.info(
                "target error %.3g: noise %.3g; %d samples a pixel; %s", target, result.noise, done, spent
            )
            say_missed_target(result.noise, target)
        return result

    @staticmethod
    def _whole_of(spread: Spread[Any], final: bool) -> Result:
        """The picture of all that is done; what is lost is rendered again."""
        while (result := spread.result(final)) is None:
            spread.find_lost()
            for _ in spread.steps(None, lambda: 0):
                pass
        return result

    def _so_far(self) -> Result | None:
        """The picture so far; None where a worker has just lost a part of it."""
        result = None if self._spread is None else self._spread.result(final=False)
        return None if result is None else self._whole(result)

    def _whole(self, result: Result) -> Result:
        order = self.order
        if order.choices.target_error is not None:
            result.metadata["target_error"] = order.choices.target_error
            result.metadata["seconds"] = round(result.metadata["seconds"] + self._surveyed, 4)
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
    bounded = order.time_limit is None and order.choices.target_error is None
    spp = order.count if bounded else None
    choices = order.planned().choices.but(target_error=None)  # every pixel has as many samples
    job = Job(order.scene, choices, order.seed, order.asked, device, order.pool, spp)
    workers: Any
    if order.client is not None:
        workers = DaskWorkers(job, order.client)
    else:
        several = names_several(order.device)
        workers = DeviceWorkers(job, open_devices(order.device) if several else [open_device(order.device)])
    try:
        yield SpreadOrder(order, workers, job)
    finally:
        workers.close()
