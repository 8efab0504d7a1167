"""Signals that end work early and keep what is done: Ctrl-C, and for commands also SIGTERM and SIGHUP.

Signals belong to the process: a block that asks for them shares what one round it holds, so that a command
goes on holding them from the first sample, inside `clvol.render`, until its files are written.
"""

from __future__ import annotations

import math
import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupt:
    """How often, and first by which signal, an early end was asked for.

    numbers : the signals; those that the process ignores, as background jobs of a shell script ignore Ctrl-C,
        it goes on ignoring.
    """

    def __init__(self, numbers: tuple[int, ...]) -> None:
        self.numbers = numbers
        self.level = 0
        """1 asks to begin nothing new, 2 to finish nothing either."""
        self.number: int | None = None
        self._patience = 0.0
        self._previous: dict[int, Any] = {}

    def asked(self) -> bool:
        """Whether there was any."""
        return self.level > 0

    def urgency(self) -> int:
        """The level: a render is told it whenever it asks."""
        return self.level

    @property
    def status(self) -> int:
        """Exit status of a command that they ended, by the shell's convention."""
        return 128 + (self.number or signal.SIGINT)

    def heed(self, patience: int) -> None:
        """From now on signals count, and interrupt as Ctrl-C does in Python only after so many."""
        self._patience = patience
        for number in self.numbers if not self._previous else ():
            previous = signal.getsignal(number)
            if previous is signal.SIG_IGN:
                # a compiler of kernels catches it nevertheless, and then gives SIGTERM back its default
                signal.signal(number, signal.SIG_IGN)
            elif previous is not None:
                self._previous[number] = previous
                signal.signal(number, self._on_signal)

    def keep(self) -> None:
        """There is something to lose now: signals only count until the block ends."""
        self._patience = math.inf

    def release(self) -> None:
        """Signals do again what they did before."""
        for number, previous in self._previous.items():
            signal.signal(number, previous)
        self._previous = {}

    def renew(self) -> None:
        """Take the signals back that something else has taken to itself."""
        for number in self._previous:
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.level += 1
        self.number = self.number or number
        if self.level <= self._patience:
            return
        self._patience = self.level + 1  # a moment for whoever catches what follows
        previous = self._previous[number]
        if not callable(previous):
            raise KeyboardInterrupt
        previous(number, frame)


_held: Interrupt | None = None


def renew() -> None:
    """See that the signals that a block holds still come to it, after code that handles signals itself."""
    if _held is not None and threading.current_thread() is threading.main_thread():
        _held.renew()


@contextmanager
def interruptible(numbers: tuple[int, ...] = (signal.SIGINT,)) -> Iterator[Interrupt]:
    """What an outer block holds, else an `Interrupt` of its own, released at the end.

    Signals are left alone until it is told to `heed` them, and in threads, which get none.
    """
    global _held
    if threading.current_thread() is not threading.main_thread():
        yield Interrupt(())
        return
    if _held is not None:
        yield _held
        return
    _held = Interrupt(numbers)
    try:
        yield _held
    finally:
        _held.release()
        _held = None
