"""A client of Dask, and what may go wrong between it and its workers."""

from __future__ import annotations

import logging
import queue
import sys
import threading
import time
import uuid
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from clvol.cluster import on_worker
from clvol.errors import Error, OptionError, RenderError, shown
from clvol.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

log = logging.getLogger("clvol")
_WAITING_EACH = 2
"""Tasks handed out for each worker: one that it renders, and one that waits there."""
_COUNT_SECONDS = 1.0
"""How often the workers are counted."""
_SENDING_TRIES, _SENDING_SECONDS = 20, 0.2
"""How often, and how long after a failure, something is sent again."""
_CLOSING_SECONDS = 2.0
"""How long workers are waited for at the end."""


class Link:
    """The workers that a `distributed.Client` knows, and the tasks that they have of one piece of work.

    Parameters
    ----------
    client : raises OptionError for what is none, or is closed.
    name : of the work, by which ends are asked for.
    """

    def __init__(self, client: Any, name: str = "") -> None:
        self._client, self.name = check_client(client), name or uuid.uuid4().hex
        self._ended: queue.Queue[Any] = queue.Queue()
        self._counted, self._workers = -_COUNT_SECONDS, 0
        self._pending: set[Any] = set()
        self._names = 0
        self._had_any = self._said_waiting = False

    def count(self) -> int:
        """Workers there are, at most `_COUNT_SECONDS` ago."""
        now = time.perf_counter()
        if now - self._counted > _COUNT_SECONDS:
            self._workers, self._counted = len(self.asked(self._client.nthreads)), time.perf_counter()
            self._say_waiting()
        return self._workers

    def _say_waiting(self) -> None:
        """Warn once where there is no worker, and anew when all there were are gone."""
        if self._workers:
            self._had_any, self._said_waiting = True, False
        elif not self._said_waiting:
            self._said_waiting = True
            what = "no workers any more" if self._had_any else "no workers yet"
            log.warning("the cluster has %s: waiting for some; Ctrl-C ends the render", what)

    def asked(self, ask: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """What the scheduler answers; RenderError where it is gone."""
        self.check()
        try:
            return ask(*arguments, **options)
        except OSError as error:
            raise _gone() from error

    def check(self) -> None:
        """RenderError where the scheduler is gone."""
        if self._client.status != "running":
            raise _gone()

    def room(self, left: int) -> int:
        """How many tasks its workers do not have yet, with one in reserve for each."""
        return min(left, _WAITING_EACH * self.count() - self._under_way())

    def _under_way(self) -> int:
        self._pending = {future for future in self._pending if future.status == "pending"}
        return len(self._pending)

    def idle(self) -> bool:
        """Whether there are fewer tasks under way than workers."""
        return self._under_way() < self.count()

    def scatter(self, what: Any, everywhere: bool) -> Any:
        """Send something to a worker, or to all; to another where one goes away meanwhile."""
        for _ in range(_SENDING_TRIES):
            self.check()
            try:
                return self._client.scatter(what, broadcast=everywhere, hash=False)
            except OSError:  # of the scheduler's with a worker, too
                time.sleep(_SENDING_SECONDS)
        raise _gone()

    def submit(self, function: Callable[..., Any], *arguments: Any, key: str, **options: Any) -> Any:
        """Have a worker call a function; `key` begins the task's name."""
        name = f"clvol-{key}-{self._new_name()}"
        return self.asked(self._client.submit, function, *arguments, key=name, **options)

    def hand_out(self, function: Callable[..., Any], *arguments: Any, key: str) -> Any:
        """As `submit`, of a task that `room` counts and whose end `wait` tells."""
        future = self.submit(function, *arguments, key=key)
        self._pending.add(future)
        future.add_done_callback(self._ended.put)
        return future

    def _new_name(self) -> str:
        self._names += 1
        return f"{self.name}-{self._names}"

    def wait(self, seconds: float) -> list[Any]:
        """Tasks handed out that came to an end meanwhile."""
        try:
            return [self._ended.get(timeout=seconds)]
        except queue.Empty:
            self.check()
            return []

    def hurry(self, level: int, handle: Any = None) -> None:
        """Tell all workers, whatever they are at, to end all of it or one task."""
        self._tell_all(on_worker.hurry, self.name if handle is None else handle.key, level)
        if handle is not None:
            handle.cancel()

    def close(self) -> None:
        """Have the workers end what they are at, and forget the work."""
        telling = self._tell_all(on_worker.forget, self.name)
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


def _gone() -> RenderError:
    return RenderError("the cluster's scheduler is gone", hint="is it still running, and can it be reached?")


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


def in_our_words(error: BaseException) -> Error:
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
