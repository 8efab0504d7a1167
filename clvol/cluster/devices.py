"""The devices of this machine as workers: a thread for each."""

from __future__ import annotations

import queue
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from clvol.cluster.job import Renderer, Stopped
from clvol.picture.parts import sum_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from clvol.cluster.job import About, Job
    from clvol.device.device import Device
    from clvol.picture.parts import Part


@dataclass(eq=False)
class _Lane:
    """One device: its thread, and how fast it has been.

    Parameters
    ----------
    seconds, samples : that it took for, and did of each pixel.
    """

    device: Device
    thread: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(1, "clvol-device"))
    renderer: Renderer | None = None
    running: Future[Part] | None = None
    seconds: float = 0.0
    samples: int = 0

    @property
    def rate(self) -> float | None:
        """Samples of each pixel a second; None while unknown."""
        return self.samples / self.seconds if self.samples else None


class DeviceWorkers:
    """Opened devices.

    Each takes another range when it is done with one, so that they share by how fast they are; towards the
    end a slow one gets none that others would be done with sooner.
    """

    def __init__(self, job: Job, devices: Sequence[Device]) -> None:
        self.job = job
        self._lanes = [_Lane(device) for device in devices]
        self._levels: dict[Future[Part] | None, int] = {}
        self._ended: queue.Queue[Future[Part]] = queue.Queue()
        self._about: About | None = None

    def room(self, left: int) -> int:
        """How many idle devices are of use for the rest."""
        return len(self._useful(left))

    def _useful(self, left: int) -> list[_Lane]:
        """Idle devices, the fastest first, but for those that others would not wait for."""
        idle = [lane for lane in self._lanes if lane.running is None]
        idle.sort(key=lambda lane: -(lane.rate or 0.0))
        rates = {lane: lane.rate for lane in self._lanes}
        known = [rate for rate in rates.values() if rate is not None]
        if len(known) < len(rates):
            return idle
        busy = len(self._lanes) - len(idle)

        def worth(lane: _Lane) -> bool:
            others = sum(known) - (lane.rate or 0.0)
            return others == 0.0 or 1 / (lane.rate or 1.0) <= (left + busy) / others

        return [lane for lane in idle if worth(lane)]

    def idle(self) -> bool:
        """Whether a device has nothing to do."""
        return any(lane.running is None for lane in self._lanes)

    def render(self, first: int, count: int, seed: int) -> Future[Part]:
        """Hand a range to the fastest device that has nothing to do."""
        lane = next(iter(self._useful(1 << 62)))
        future: Future[Part] = Future()
        lane.running = future
        lane.thread.submit(self._run, lane, future, (first, count, seed))
        return future

    def _run(self, lane: _Lane, future: Future[Part], samples: tuple[int, int, int]) -> None:
        """In the device's thread."""
        try:
            if lane.renderer is None:
                lane.renderer = Renderer(self.job, lane.device)
                self._about = self._about or lane.renderer.about()
            started = time.perf_counter()
            part = lane.renderer.part(
                *samples, lambda: max(self._levels.get(None, 0), self._levels.get(future, 0))
            )
            lane.seconds += time.perf_counter() - started
            lane.samples += part.samples
            future.set_result(part)
        except BaseException as error:
            future.set_exception(error)
        lane.running = None
        self._ended.put(future)

    def add(self, handles: list[Future[Part]]) -> Future[Part]:
        """Add sums, here and now."""
        future: Future[Part] = Future()
        future.set_result(sum_of([handle.result() for handle in handles]))
        return future

    def wait(self, seconds: float) -> list[Future[Part]]:
        """Ranges that came to an end meanwhile."""
        try:
            return [self._ended.get(timeout=seconds)]
        except queue.Empty:
            return []

    def is_there(self, handle: Future[Part]) -> bool:
        """Whether it has sums; raises what the device's thread raised."""
        error = handle.exception()
        if error is not None and not isinstance(error, Stopped):
            raise error
        return error is None

    def samples(self, handle: Future[Part]) -> int:
        """Samples of a pixel in the sums."""
        return handle.result().samples

    def part(self, handle: Future[Part]) -> Part:
        """The sums."""
        return handle.result()

    def about(self) -> About | None:
        """What the first device that was ready said."""
        return self._about

    def hurry(self, level: int, handle: Future[Part] | None = None) -> None:
        """Ask for an end, of one range or of all."""
        self._levels[handle] = level

    def close(self) -> None:
        """End the threads, which are waited for: they hold what the scene takes on their devices."""
        self.hurry(3)
        for lane in self._lanes:
            lane.thread.shutdown(wait=True)
            lane.renderer = None
