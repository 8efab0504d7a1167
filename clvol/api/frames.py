"""`clvol.progressive`: a render one frame after the other, each a picture of all samples so far."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Self

from clvol.api.order import Order
from clvol.api.renders import defaults
from clvol.api.spreading import opened
from clvol.base.arguments import positive
from clvol.base.interrupts import interruptible
from clvol.errors import OptionError, RenderError, UnknownOptionError
from clvol.picture.result import Result

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from clvol.api.order import Opened
    from clvol.api.spreading import SpreadOrder
    from clvol.base.interrupts import Interrupt
    from clvol.scene.records import Scene

_WITHOUT = ("progress", "profile")
"""Options of `clvol.render` that a loop over frames has no use for."""
_FRAME_SHARE = 0.1
"""Of the time, that making frames may take at most: then they are further apart."""


@dataclass(eq=False, repr=False)
class Frame(Result):
    """A picture of the samples so far, one of `clvol.progressive`.

    It is a `Result` like any other: unbiased, with its noise, and can be saved and merged.  It has the bits
    of a render of as many samples.

    Parameters
    ----------
    is_last : bool
        The render is done: it is what `clvol.render` returns.
    """

    is_last: bool = False
    _cancel: Callable[[], None] = field(default=lambda: None)

    def cancel(self) -> None:
        """End the render: no frame comes after this one.  Any thread may call it."""
        self._cancel()


class _End:
    """Whether an end was asked for, and how urgently; shared by whoever renders and whoever may ask."""

    def __init__(self) -> None:
        self.cancelled = threading.Event()
        self.interrupt: Interrupt | None = None
        self.level = 0

    def urgency(self) -> int:
        """As `Wavefront.passes` takes it: Ctrl-C lets the paths in flight end, who cancels does not wait."""
        if self.interrupt is not None:
            self.level = max(self.level, self.interrupt.urgency())
        return 3 if self.cancelled.is_set() else self.level


class Frames:
    """An iterator over the frames of one render, made by `clvol.progressive`.

    Leaving its loop for good ends the render and gives the device's memory back.  So does `close`, as at the
    end of a ``with`` block.
    """

    def __init__(self, order: Order, interval: float) -> None:
        self._end = _End()
        self._frames = _rendered(order, interval, self._end)  # which holds no reference to this object

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Frame:
        with interruptible() as interrupt:
            interrupt.heed(patience=2)
            self._end.interrupt = interrupt
            try:
                return next(self._frames)
            finally:
                self._end.urgency()  # what came while the frame was made counts, too

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def cancel(self) -> None:
        """End the render soon.  Any thread may call it.

        The loop gets one more frame where there are more samples finished than its last one has.
        """
        self._end.cancelled.set()

    def close(self) -> None:
        """End the render at once; for the thread that iterates."""
        self._frames.close()


def _rendered(order: Order, interval: float, end: _End) -> Generator[Frame, None, None]:
    """The frames of an order, at least `interval` seconds apart."""
    with opened(order, callback=None) as render:
        done = shown = 0
        due = 0.0
        try:
            for done in render.steps(None, end.urgency):
                started = time.perf_counter()
                if started >= due and done < order.count:
                    frame = _frame(render, done, end, is_last=False)
                    now = time.perf_counter()
                    due = now + (max(interval, (now - started) / _FRAME_SHARE) if interval else 0.0)
                    yield frame
                    if end.cancelled.is_set():
                        return
                    shown = done
        except (KeyboardInterrupt, RenderError):
            if not end.cancelled.is_set():
                raise
        if done > shown or not end.cancelled.is_set():
            yield _frame(render, done, end, is_last=True)


def _frame(render: Opened | SpreadOrder, done: int, end: _End, is_last: bool) -> Frame:
    result = render.result(done, final=is_last)
    result.stats["interrupted"] = end.level > 0
    values = {one.name: getattr(result, one.name) for one in fields(Result)}
    return Frame(**values, is_last=is_last, _cancel=end.cancelled.set)


def progressive(scene: Scene, *, interval: float = 0.25, **options: Any) -> Frames:
    """Render a scene, and look at it meanwhile: ``for frame in clvol.progressive(scene, spp=256): ...``.

    Each frame is a picture of all samples so far, and has the bits of a render of just so many.  So it is
    unbiased, with its noise, and `Frame.save` and `merge` take it.  The first comes as soon as every pixel
    has a sample.  The last is the result of `render`, and says `Frame.is_last`.

    ``break`` ends the render, and so does `Frame.cancel`, in the loop or from another thread, and
    `Frames.cancel`.

    Parameters
    ----------
    scene
        As for `render`.
    interval
        Seconds from one frame to the next, at least; more where making a frame takes over a tenth of it.
        0: a frame whenever every pixel has more samples.
    options
        What `render` takes, but for progress and profile.  With a `target_error` frames come whenever the
        samples have been dealt out.

    Returns
    -------
    Frames
        An iterator.  Ctrl-C, while it renders, finishes the paths in flight, and the frame after it is the
        last, with ``stats["interrupted"]`` set.

    Raises
    ------
    OptionError, SceneError
        At once, for what won't do.  What `render` raises beside these comes with the first frame.
    UnknownOptionError
        A keyword that `render` does not know; a TypeError as well.
    """
    known = {name: default for name, default in defaults().items() if name not in _WITHOUT}
    for name in options:
        if name not in known:
            raise UnknownOptionError(f"progressive takes interval and {', '.join(known)}, not {name!r}")
    if not isinstance(interval, int | float) or interval != 0:
        positive("interval=", interval, " of seconds")
    order = Order.of("progressive", scene, known | options)
    if not order.count:
        raise OptionError("there is nothing to render: the picture to go on from has these samples")
    return Frames(order, interval)
