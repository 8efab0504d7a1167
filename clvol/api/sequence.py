"""Many pictures, each of which a worker of a Dask cluster renders as a whole.

A worker takes another when it is done with one.  What a worker that dies was at, another renders; a picture
that takes twice as long as others is given to an idle worker as well, and who is first counts: each comes out
once, with the bits that a device of the kind gives it alone.
"""

from __future__ import annotations

import logging
import statistics
import time
from collections import deque
from typing import TYPE_CHECKING, Any

from clvol.api.renders import defaults
from clvol.api.whole import Whole, rendered
from clvol.cluster.job import Stopped, UnfitError
from clvol.cluster.link import Link, in_our_words
from clvol.errors import DeviceError, Error, OptionError, RenderError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from clvol.api.whole import Said
    from clvol.picture.result import Result
    from clvol.scene.records import Scene

log = logging.getLogger("clvol")
_TICK = 0.1
"""Seconds after which the end is looked for again."""
_STRAGGLER = 2.0
"""Times what half of the pictures took: one that takes longer is given to another worker as well."""
_SHORT_SECONDS = 2.0
"""Pictures that take less are taken for as long: sooner nobody is late."""
_MOST_LOSSES = 20
"""Times that one picture may be lost with its worker before it is given up."""


class Pictures:
    """Pictures under way.

    Parameters
    ----------
    client : of the cluster.
    options : of `clvol.render`, for all of them.
    scene_of : a number to the scene of its picture; called again where a worker dies, and for stragglers.
        Error, OSError or MemoryError fail that picture alone.
    """

    def __init__(self, client: Any, options: Mapping[str, Any], scene_of: Callable[[int], Scene]) -> None:
        self._link, self._scene_of = Link(client), scene_of
        self._options = defaults() | dict(options) | {"client": None, "progress": False}
        self._under_way: dict[Any, int] = {}
        self._since: dict[int, float] = {}
        self._again: deque[int] = deque()
        self._losses: dict[int, int] = {}
        self._took: list[float] = []
        self._failed: deque[tuple[int, Exception]] = deque()

    def results(
        self, numbers: Iterable[int], urgency: Callable[[], int] = lambda: 0
    ) -> Iterator[tuple[int, Result | Exception]]:
        """Each number with its picture, or with what went wrong, as they come.

        Numbers are taken as workers have room.  Where an end is asked for, what is done still comes, and what
        is under way is given up.  Raises DeviceError and OptionError of workers that cannot render at all,
        and RenderError where the scheduler is gone.
        """
        left = iter(numbers)
        exhausted = False
        try:
            while not urgency():
                exhausted = self._deal(left, exhausted)
                if exhausted and not self._again:
                    self._help_a_straggler()
                yield from self._come(_TICK)
                if exhausted and not (self._under_way or self._again or self._failed):
                    return
            while self._under_way and (come := list(self._come(0.0))):
                yield from come
        finally:
            self._link.hurry(3)
            for future in self._under_way:
                future.cancel()
            self._link.close()

    def _deal(self, left: Iterator[int], exhausted: bool) -> bool:
        """Hand out pictures as long as there is room; whether all numbers were taken."""
        while self._link.room(1) > 0:
            if self._again:
                number = self._again.popleft()
            elif exhausted or (following := next(left, None)) is None:
                return True
            else:
                number = following
            self._hand_out(number)
            if self._failed:
                break
        return exhausted

    def _hand_out(self, number: int) -> None:
        self._since.setdefault(number, time.perf_counter())
        try:
            scene = self._scene_of(number)
        except (Error, OSError, MemoryError) as error:
            self._failed.append((number, error))
            return
        one = Whole(scene, self._options, self._link.name, log.getEffectiveLevel())
        sent = self._link.scatter(one, everywhere=False)
        self._under_way[self._link.hand_out(rendered, sent, key=f"frame-{number}")] = number

    def _help_a_straggler(self) -> None:
        """Give what takes long to another worker as well, once there is nothing else: who is first counts."""
        if len(self._took) < 2 or not self._link.idle():
            return
        usual = max(statistics.median(self._took), _SHORT_SECONDS)
        late = time.perf_counter() - _STRAGGLER * usual
        running = list(self._under_way.values())
        for number in running:
            if self._since[number] < late and running.count(number) == 1:
                self._hand_out(number)
                return

    def _come(self, seconds: float) -> Iterator[tuple[int, Result | Exception]]:
        """What came to an end within some seconds."""
        while self._failed:
            yield self._failed.popleft()
            seconds = 0.0
        for future in self._link.wait(seconds):
            number = self._under_way.pop(future, None)
            if number is None or (found := self._outcome(future, number)) is None:
                continue
            for other in [other for other, same in self._under_way.items() if same == number]:
                del self._under_way[other]
                self._link.hurry(3, other)
            if not isinstance(found, Exception):
                self._took.append(time.perf_counter() - self._since[number])
            yield number, found

    def _outcome(self, future: Any, number: int) -> Result | Exception | None:
        """Of a task that has ended; None where it was lost, and is to be rendered again."""
        from concurrent.futures import CancelledError

        try:
            result, said = future.result()
        except (CancelledError, Stopped):
            return self._lost(number)
        except Exception as error:
            if isinstance(error, DeviceError | UnfitError):
                raise
            ours = in_our_words(error)
            if isinstance(ours, OptionError) and ours is not error:
                raise ours from error  # the worker cannot load clvol
            return ours
        _tell(said)
        found: Result = result
        return found

    def _lost(self, number: int) -> RenderError | None:
        """Render a picture again whose worker went away with what it had of it."""
        self._link.check()
        if number in self._under_way.values():
            return None
        self._losses[number] = self._losses.get(number, 0) + 1
        if self._losses[number] > _MOST_LOSSES:
            return RenderError(f"its workers went away {_MOST_LOSSES} times, and what they had with them")
        del self._since[number]
        self._again.append(number)
        return None


def _tell(said: list[Said]) -> None:
    """Log here what a worker's log has."""
    for level, message, arguments in said:
        log.log(level, message, *(arguments or ()))
