"""Clients of Dask for commands: of a scheduler by its address, or of workers on this machine."""

from __future__ import annotations

import logging
import os
import signal
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from clvol.base.extras import need
from clvol.errors import OptionError, option

if TYPE_CHECKING:
    from collections.abc import Iterator

_CONNECT_SECONDS = 10
_ANY_PORT = "127.0.0.1:0"


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of the scheduler at an address; OptionError where none answers."""
    distributed = _distributed("scheduler")
    try:
        client = distributed.Client(scheduler, timeout=_CONNECT_SECONDS)
    except (OSError, ValueError, TypeError) as error:
        raise OptionError(
            f"no scheduler answers at {scheduler} ({' '.join(str(error).split()) or type(error).__name__})",
            hint="give the address that `dask scheduler` prints, as tcp://10.0.0.1:8786",
        ) from None
    with client:
        yield client


@contextmanager
def started(workers: int) -> Iterator[Any]:
    """A client of so many workers, which are started here, share the processors and end with the block."""
    distributed = _distributed("workers")
    threads = str(max(1, (os.cpu_count() or 1) // workers))
    with _without_ctrl_c():
        made = distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=_ANY_PORT,
            silence_logs=logging.CRITICAL,
            preload=["clvol.cluster.ctrl_c"],
            env={"POCL_MAX_PTHREAD_COUNT": threads},
        )
    with made as cluster, distributed.Client(cluster) as client:
        yield client


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Ctrl-C waits until the block's end, and never comes to processes and threads that are started in it.

    Workers ignore it (`clvol.cluster.ctrl_c`), but a terminal sends it to those as well that still start.
    """
    resource_tracker.ensure_running()  # starting it would let Ctrl-C in again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _distributed(name: str) -> Any:
    return need("distributed", str(option(name)), "cluster")
