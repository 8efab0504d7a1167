"""One whole picture on a worker: a frame of a sequence, with the bits that it has without a cluster."""

from __future__ import annotations

import logging
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from clvol.api.order import Order
from clvol.api.spreading import opened
from clvol.cluster import on_worker
from clvol.cluster.job import Stopped
from clvol.errors import Error, RenderError
from clvol.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from clvol.picture.result import Result
    from clvol.scene.records import Scene

log = logging.getLogger("clvol")
Said = tuple[int, Any, Any]
"""A record of the log: its level, message and arguments."""


@dataclass(frozen=True, eq=False)
class Whole:
    """What a worker is to render.

    Parameters
    ----------
    options : of `clvol.render`.
    name : of the sequence that it is of.
    level : of the log, from which on records are wanted.
    version : of clvol, which the worker must have.
    """

    scene: Scene
    options: Mapping[str, Any]
    name: str
    level: int
    version: str = field(default=__version__)


def rendered(one: Whole) -> tuple[Result, list[Said]]:
    """On a worker: the picture, and what the log said of it; `Stopped` where it was to end meanwhile."""
    key = on_worker.task_key()

    def urgency() -> int:
        return on_worker.urgency_of(one.name, key)

    with on_worker.turn, _records(one.level) as said:
        try:
            if urgency():
                raise Stopped("was to end before it began")
            on_worker.check_version(one.version)
            on_worker.forget_jobs()
            return _picture(one, urgency), said
        except Error as error:
            raise on_worker.told_from_here(error) from None
        finally:
            on_worker.forget_task(key)


def _picture(one: Whole, urgency: Any) -> Result:
    order = Order.of("render", one.scene, one.options)
    done = 0
    try:
        with opened(order, None) as render:
            for done in render.steps(None, urgency):  # noqa: B007
                pass
            if not urgency():
                result = render.result(done)
                result.stats["interrupted"] = False
                return result
    except (KeyboardInterrupt, RenderError):
        if not urgency():
            raise
    raise Stopped("was ended while it rendered")


@contextmanager
def _records(level: int) -> Iterator[list[Said]]:
    """What this thread logs in the block."""
    here, said = threading.get_ident(), []

    class Keeper(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.thread == here:
                said.append((record.levelno, record.msg, record.args))

    handler, before = Keeper(level), log.level
    log.addHandler(handler)
    log.setLevel(level)
    try:
        yield said
    finally:
        log.removeHandler(handler)
        log.setLevel(before)
