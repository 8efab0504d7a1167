"""Preloaded by workers that a command starts: a terminal sends Ctrl-C to all of its processes.

The command ends the render and keeps the picture, for which it needs its workers a little longer.
"""

from __future__ import annotations

import signal


def dask_setup(_worker: object) -> None:
    """What Dask calls in each worker, in its main thread."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
