"""Silence for what measures with many small renders: it tells what they have to say itself."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet_renders() -> Iterator[None]:
    """Drops what is logged of single renders; loggers below "clvol" still speak."""
    log = logging.getLogger("clvol")

    def keep(record: logging.LogRecord) -> bool:
        return record.levelno > logging.WARNING

    log.addFilter(keep)
    try:
        yield
    finally:
        log.removeFilter(keep)
