"""Signals at a known moment."""

from __future__ import annotations

import signal
import time

from clvol.base import interrupts


def press_key(number: signal.Signals) -> None:
    """Send a signal to this process, whose command or render holds it, and return once it was taken.

    Python may put it off where other threads run, and two would merge.  A signal that the process ignores, as
    background jobs ignore Ctrl-C (see the fixture `ctrl_c`), never is.
    """
    held = interrupts._held
    before = held.level
    assert signal.getsignal(number) is not signal.SIG_IGN, f"{number!r} is ignored here"
    signal.raise_signal(number)
    while held.level == before:
        time.sleep(0.001)
