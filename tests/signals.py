"""Signals at a known moment."""

from __future__ import annotations

import signal
import time

from clvol import interrupts


def press_key(number: signal.Signals) -> None:
    """Send a signal to this process, whose command or render holds it, and return once it was taken.

    Python may put it off where other threads run, and two would merge.
    """
    held = interrupts._held
    before = held.level
    signal.raise_signal(number)
    while held.level == before:
        time.sleep(0.001)
