"""Silence for what measures with many small renders: it tells what they have to say itself."""

from __future__ import annotations

import logging
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def log_filter(keep: Callable[[logging.LogRecord], bool]) -> Iterator[None]:
    """Only what `keep` says is logged of single renders; loggers below "clvol" still speak."""
    log = logging.getLogger("clvol")
    log.addFilter(keep)
    try:
        yield
    finally:
        log.removeFilter(keep)


def quiet_renders() -> AbstractContextManager[None]:
    """Drops all but errors."""
    return log_filter(lambda record: record.levelno > logging.WARNING)
