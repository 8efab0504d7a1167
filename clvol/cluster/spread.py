"""Deals out the ranges of a picture, gathers their sums, and tells how far it is."""

from __future__ import annotations

import logging
import statistics
import time
from collections import deque
from typing import TYPE_CHECKING, Generic

from clvol.cluster.ranges import Tree, sample_ranges
from clvol.cluster.workers import Handle, Workers
from clvol.rendering.doubts import say_doubts, say_seconds
from clvol.rendering.session import nothing_finished

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from clvol.cluster.job import Job
    from clvol.picture.result import Result

log = logging.getLogger("clvol")
_TICK = 0.1
"""Seconds after which the end is looked for again."""
_PATIENCE_SECONDS = {1: 40.0, 2: 5.0}
"""How long ranges under way are waited for, by how urgently an end was asked for."""
_STRAGGLER = 2.0
"""Times what half of the ranges took: one that takes longer is given to another worker as well."""
_SHORT_SECONDS = 1.0
"""Ranges that take less are taken for as long: sooner nobody is late."""


class _Range:
    """One of them; handles of it, and when it was handed out."""

    def __init__(self, number: int, first: int, count: int) -> None:
        self.number, self.first, self.count = number, first, count
        self.since = time.perf_counter()


class Spread(Generic[Handle]):
    """A picture under way.

    Parameters
    ----------
    first, count, seed : its samples of a pixel.
    told : the log has said how workers render it.

    Attributes
    ----------
    done, seconds : samples of a pixel that are, and the time since the first worker was ready.
    """

    def __init__(
        self, workers: Workers[Handle], job: Job, first: int, count: int, seed: int, told: bool = False
    ) -> None:
        self._workers, self._seed = workers, seed
        self._ranges = enumerate(sample_ranges(first, count, job.pixels))
        self._left = -(-count // max(1, next(sample_ranges(first, count, job.pixels))[1]))
        self._again: deque[_Range] = deque()
        self._under_way: dict[Handle, _Range] = {}
        self._numbered: dict[int, _Range] = {}
        self._tree: Tree[Handle] = Tree(workers.add)
        self._took: list[float] = []
        self._level, self._stopping_since = 0, 0.0
        self._started: float | None = None
        self._told = told
        self.done = 0
        self.seconds = 0.0

    def steps(self, time_limit: float | None, urgency: Callable[[], int]) -> Iterator[int]:
        """Render, and stop wherever there are more samples: at how many of each pixel are done.

        Raises what workers raise, and RenderError where it was to end and nothing was done.
        """
        while True:
            level = max(time_limit is not None and self._spent() >= time_limit, urgency())
            if level > self._level:
                self._level, self._stopping_since = int(level), time.perf_counter()
                self._workers.hurry(self._level)
            if not self._level:
                self._deal()
                self._help_stragglers()
            if not self._under_way and (self._level or not (self._left or self._again)):
                break
            had = self.done
            for handle in self._workers.wait(_TICK):
                self._take(handle)
            self._tell()
            self.seconds = self._spent()
            if self.done > had:
                yield self.done
            if self._is_out_of_patience():
                break
        self.seconds = self._spent()
        if not self.done:
            raise nothing_finished(self._level)

    def _spent(self) -> float:
        """Seconds since the first worker was ready."""
        return 0.0 if self._started is None else time.perf_counter() - self._started

    def _is_out_of_patience(self) -> bool:
        """Whether ranges under way are no longer waited for."""
        waited = time.perf_counter() - self._stopping_since
        if not (self._level and self._under_way and waited > _PATIENCE_SECONDS.get(self._level, 0.0)):
            return False
        if self._level < 3:
            log.warning("dropped %d ranges that did not end", len(self._under_way))
        return True

    def _deal(self) -> None:
        """Hand out ranges as long as there is room."""
        for _ in range(self._workers.room(self._left + len(self._again))):
            if self._again:
                one = self._again.popleft()
                one.since = time.perf_counter()
            elif (following := next(self._ranges, None)) is not None:
                number, (first, count) = following
                one = self._numbered[number] = _Range(number, first, count)
                self._left -= 1
            else:
                return
            self._under_way[self._workers.render(one.first, one.count, self._seed)] = one

    def _help_stragglers(self) -> None:
        """Give what takes long to another worker as well, once there is nothing else: who is first counts."""
        if self._left > 0 or self._again or len(self._took) < 3 or not self._workers.idle():
            return
        usual = max(statistics.median(self._took), _SHORT_SECONDS)
        late = time.perf_counter() - _STRAGGLER * usual
        running = list(self._under_way.values())
        for one in sorted(running, key=lambda one: one.since):
            if one.since < late and running.count(one) == 1:
                self._under_way[self._workers.render(one.first, one.count, self._seed)] = one
                return

    def _take(self, handle: Handle) -> None:
        """What became of a range."""
        one = self._under_way.pop(handle, None)
        if one is None:
            return  # another worker was first
        if not self._workers.is_there(handle):
            if not self._level and one not in self._under_way.values():
                self._again.append(one)
                self.find_lost()
            return
        for other in [other for other, same in self._under_way.items() if same is one]:
            del self._under_way[other]
            self._workers.hurry(3, other)
        samples = self._workers.samples(handle) if self._level else one.count
        if samples:
            self._took.append(time.perf_counter() - one.since)
            self._tree.put(one.number, handle)
            self.done += samples

    def _tell(self) -> None:
        """Log what the first worker says of the plan."""
        about = self._workers.about() if self._started is None else None
        if about is not None:
            self._started = time.perf_counter()
            if self._told:
                return
            log.info("device: %s", about.device)
            for line in about.plan:
                log.info("%s", line)
            for warning in about.warnings:
                log.warning("%s", warning)

    def result(self, final: bool = True) -> Result | None:
        """The picture of what is done, its doubts told where it is `final`; None where sums are lost."""
        handle = self._tree.root() if final else self._workers.add(self._tree.tops())
        part = self._workers.part(handle)
        if part is None:
            return None
        result = part.result()
        result.metadata["seconds"] = round(self.seconds, 4)
        about = self._workers.about()
        if final and about is not None:
            say_doubts(result, about.expected)
            say_seconds(result)
        return result

    def find_lost(self) -> None:
        """Put the ranges whose sums are lost back to what is to be rendered."""
        for numbers in self._tree.lost(lambda handle: not self._workers.is_there(handle)):
            for number in numbers:
                if (one := self._numbered.get(number)) is not None:
                    self._again.append(one)
                    self.done -= one.count
