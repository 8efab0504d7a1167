"""The workers of a Dask cluster: how ranges get there, and what may go wrong on the way."""

from __future__ import annotations

import logging
import queue
import sys
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from clvol.cluster import on_worker
from clvol.cluster.job import Stopped
from clvol.errors import Error, OptionError, RenderError, shown
from clvol.picture.parts import sum_of
from clvol.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from clvol.cluster.job import About, Job
    from clvol.picture.parts import Part

log = logging.getLogger("clvol")
_WAITING_EACH = 2
"""Ranges handed out for each worker: one that it renders, and one that waits there."""
_COUNT_SECONDS = 1.0
"""How often the workers are counted."""
_CLOSING_SECONDS = 2.0
"""How long workers are waited for at the end."""
_MOST_LOSSES = 20
"""Times in a row that all workers that have the scene may go away before the render ends."""


class DaskWorkers:
    """The workers that a `distributed.Client` knows.

    Raises OptionError for what is no client, or one that is closed.
    """

    def __init__(self, job: Job, client: Any) -> None:
        self.job, self._client = job, check_client(client)
        self._ended: queue.Queue[Any] = queue.Queue()
        self._counted, self._workers = -_COUNT_SECONDS, 0
        self._pending: set[Any] = set()
        self._scene: Any = None
        self._given: dict[str, Any] = {}  # the scene that each range was handed out with, by its key
        self._about: Any = None
        self._copies = self._losses = 0
        self._said_waiting = False

    def _count(self) -> int:
        """Workers there are, at most `_COUNT_SECONDS` ago."""
        now = time.perf_counter()
        if now - self._counted > _COUNT_SECONDS:
            self._workers, self._counted = len(self._asked(self._client.nthreads)), time.perf_counter()
            if not self._workers and not self._said_waiting:
                self._said_waiting = True
                log.warning("the cluster has no workers yet: waiting for the first")
        return self._workers

    def _asked(self, ask: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """What the scheduler answers; RenderError where it is gone."""
        if self._client.status != "running":
            raise self._gone()
        try:
            return ask(*arguments, **options)
        except OSError as error:
            raise self._gone() from error

    def _gone(self) -> RenderError:
        return RenderError(
            "the cluster's scheduler is gone", hint="is it still running, and can it be reached?"
        )

    def room(self, left: int) -> int:
        """How many ranges its workers do not have yet, with one in reserve for each."""
        return min(left, _WAITING_EACH * self._count() - self._under_way())

    def _under_way(self) -> int:
        self._pending = {future for future in self._pending if future.status == "pending"}
        return len(self._pending)

    def idle(self) -> bool:
        """Whether there are fewer ranges under way than workers."""
        return self._under_way() < self._count()

    def render(self, first: int, count: int, seed: int) -> Any:
        """Hand out a range."""
        if self._scene is None:
            self._scene = self._asked(self._client.scatter, self.job, broadcast=True, hash=False)
            self._about = self._asked(
                self._client.submit,
                on_worker.about,
                self._scene,
                key=f"clvol-about-{self._new_name()}",
                priority=20,
            )
        key = f"clvol-{first}-{count}-{self._new_name()}"
        future = self._asked(
            self._client.submit, on_worker.part_of_range, self._scene, first, count, seed, key=key
        )
        self._given[key] = self._scene
        self._pending.add(future)
        future.add_done_callback(self._ended.put)
        return future

    def _new_name(self) -> str:
        self._copies += 1
        return f"{self.job.name}-{self._copies}"

    def add(self, handles: list[Any]) -> Any:
        """Have a worker add sums."""
        key = f"clvol-sum-{self._new_name()}"
        return self._asked(self._client.submit, sum_of, handles, key=key, priority=10)

    def wait(self, seconds: float) -> list[Any]:
        """Ranges that came to an end meanwhile."""
        try:
            found = [self._ended.get(timeout=seconds)]
        except queue.Empty:
            found = []
        if not found and self._client.status != "running":
            raise self._gone()
        return found

    def is_there(self, handle: Any) -> bool:
        """Whether a worker has, or will have, the sums; raises what is wrong, in our words."""
        if handle.status == "finished":
            self._losses = 0
        if handle.status in ("finished", "pending"):
            return True
        if handle.status == "error":
            error = handle.exception()
            if isinstance(error, Stopped):
                return False
            raise _in_our_words(error)
        if self._client.status != "running":
            raise self._gone()
        if self._scene is not None and self._given.get(handle.key) is self._scene:
            self._losses += 1
            self._scene = None  # all that had it are gone
            if self._losses > _MOST_LOSSES:
                raise RenderError("all workers went away again and again, and what they had with them")
        return False

    def samples(self, handle: Any) -> int:
        """Samples of a pixel in the sums."""
        found: int = self._asked(
            self._client.submit, on_worker.samples, handle, pure=False, priority=20
        ).result()
        return found

    def part(self, handle: Any) -> Part | None:
        """The sums, brought here; None where they are lost."""
        from concurrent.futures import CancelledError

        try:
            part: Part = handle.result()
        except CancelledError:
            if self._client.status != "running":
                raise self._gone() from None
            return None
        except Exception as error:
            raise _in_our_words(error) from error
        return part

    def about(self) -> About | None:
        """What the first worker that was ready said."""
        if self._about is None or self._about.status == "pending":
            return None
        if self._about.status == "error":
            raise _in_our_words(self._about.exception())
        found: About | None = self._about.result() if self._about.status == "finished" else None
        return found

    def hurry(self, level: int, handle: Any = None) -> None:
        """Tell all workers, whatever they are at."""
        self._tell_all(on_worker.hurry, self.job.name if handle is None else handle.key, level)
        if handle is not None:
            handle.cancel()

    def close(self) -> None:
        """Have the workers end what they are at, and forget the scene."""
        telling = self._tell_all(on_worker.forget, self.job.name)
        if telling.is_alive():
            telling.join(_CLOSING_SECONDS)

    def _tell_all(self, function: Callable[..., None], *arguments: Any) -> threading.Thread:
        """Call a function on each worker, and wait for none: some may hang."""

        def tell() -> None:
            with suppress(Exception):  # workers and scheduler may go away meanwhile, whatever that raises
                self._client.run(function, *arguments, on_error="ignore")

        thread = threading.Thread(target=tell, daemon=True)
        if self._client.status == "running":
            thread.start()
        return thread


def check_client(client: object) -> Any:
    """`client` if it is one of `distributed`, and open; OptionError otherwise."""
    distributed = sys.modules.get("distributed")
    if distributed is None or not isinstance(client, distributed.Client):
        hint = "client=distributed.Client(ADDRESS); pip install 'clvol[cluster]' has it"
        raise OptionError(f"{shown(client)} is no client of Dask's", hint=hint)
    if client.asynchronous:
        raise OptionError(
            "the client is asynchronous, and renders are not", hint="leave asynchronous=True out"
        )
    if client.status != "running":
        raise OptionError(f"the client's connection to the cluster is {client.status}", hint="make a new one")
    return client


def _in_our_words(error: BaseException) -> Error:
    """A fault on the cluster, as an error that says what to do."""
    if isinstance(error, Error):
        return error
    name = type(error).__name__
    if name == "KilledWorker":
        return RenderError(
            f"several workers in a row ended while they rendered ({error})",
            hint="their logs say why; have they enough memory for the scene?",
        )
    causes = [error, *filter(None, (error.__cause__, error.__context__))]
    if any(isinstance(cause, ImportError | AttributeError) for cause in causes):
        return OptionError(
            f"a worker cannot load clvol {__version__} ({name}: {error})",
            hint=f"install the same in its environment: pip install 'clvol[cluster]=={__version__}'",
        )
    return RenderError(f"a worker failed: {name}: {error}")
