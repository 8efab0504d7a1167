"""The one thread that renders: the latest wish, at first coarsely, then better and better."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from clvol.api.frames import progressive
from clvol.errors import Error

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from clvol.api.frames import Frames
    from clvol.picture.result import Result
    from clvol.viewer.subject import Subject
    from clvol.viewer.wish import Wish

COARSER = (1, 2, 3, 4, 6, 8)
"""What the sides of a picture in motion are divided by."""
MOVING_SECONDS = 0.2
"""That a picture in motion may take."""
CLEAN_PACE = 3.0
"""Times what denoising took that passes before the next."""
SMALLEST = 16
"""Pixels of its sides, at least."""


@dataclass(frozen=True, eq=False)
class Painted:
    """A picture of a wish.

    Parameters
    ----------
    coarse : it is one in motion, with fewer pixels.
    is_last : there is no better one to come.
    """

    wish: Wish
    result: Result
    coarse: bool
    is_last: bool

    @property
    def rate(self) -> float:
        """Samples per second."""
        height, width = self.result.image.shape[:2]
        seconds = float(self.result.metadata["seconds"])
        return float(width * height * self.result.samples[1] / max(seconds, 1e-9))


class Painter:
    """Renders what is wished for until it has `spp` samples, or something else is wished for.

    Parameters
    ----------
    options : of `clvol.render`, for all pictures.
    show : takes each picture, in the thread that renders.
    fail : takes what was wrong with a wish.
    first : what is wished for at first, once it is started.

    Raises
    ------
    OptionError, SceneError : options that won't do, or that the scene cannot have.
    """

    def __init__(
        self,
        subject: Subject,
        options: Mapping[str, Any],
        spp: int,
        show: Callable[[Painted], None],
        fail: Callable[[Exception], None],
        first: Wish,
    ) -> None:
        self.subject, self.options, self.spp = subject, options, spp
        self.latest: Painted | None = None
        """The best picture of the latest wish that was rendered."""
        self._show, self._fail = show, fail
        self._wish: Wish | None = None
        self._begun: Wish | None = None
        self._closed = False
        self._frames: Frames | None = None
        self._rate = math.nan
        self._clean_due = 0.0
        self._news = threading.Condition()
        self._ordered(first, subject.size, spp)
        self._thread = threading.Thread(target=self._work, name="clvol painter", daemon=True)

    def start(self) -> None:
        """Begin to paint what is wished for."""
        self._thread.start()

    def want(self, wish: Wish) -> None:
        """Paint this from now on.  What only shows a picture otherwise does not end its render."""
        with self._news:
            before, self._wish = self._wish, wish
            if self._frames is not None and (before is None or before.rendered != wish.rendered):
                self._frames.cancel()
            self._news.notify()

    def close(self) -> None:
        """End the render, and the thread."""
        with self._news:
            self._closed = True
            if self._frames is not None:
                self._frames.cancel()
            self._news.notify()
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        while (wish := self._next()) is not None:
            try:
                self._paint(wish)
            except (Error, MemoryError) as error:
                self._fail(error)

    def _next(self) -> Wish | None:
        """Wait for a wish that was not begun; None at the end."""
        with self._news:
            self._news.wait_for(lambda: self._closed or self._wish is not self._begun)
            self._begun = self._wish
            return None if self._closed else self._wish

    def _paint(self, wish: Wish) -> None:
        last = self.latest
        if last is not None and last.is_last and last.wish.rendered == wish.rendered:
            self._out(replace(last, wish=wish))
            return
        self.subject.turn(wish)
        self._clean_due = 0.0
        for size in self._coarse_sizes():
            self._render(wish, size, 1, coarse=True)
        self._render(wish, self.subject.size, self.spp, coarse=False)

    def _render(self, wish: Wish, size: tuple[int, int], spp: int, coarse: bool) -> None:
        """Show frames of one render, for as long as it is wished for."""
        with self._news:
            if self._outdated(wish):
                return
            self._frames = frames = self._ordered(wish, size, spp)
        try:
            for frame in frames:
                with self._news:
                    if self._outdated(wish):
                        return
                    self._begun = now = self._wish
                assert now is not None
                self._out(Painted(now, frame, coarse, frame.is_last and not coarse))
        finally:
            with self._news:
                self._frames = None
            frames.close()

    def _ordered(self, wish: Wish, size: tuple[int, int], spp: int) -> Frames:
        """A render that is checked, and not yet begun."""
        chosen = {name: getattr(wish, name) for name in ("technique", "transmittance")}
        options = {**self.options, **chosen, "sensor": self.subject.sensor, "size": size, "spp": spp}
        return progressive(self.subject.scene, **options)

    def _outdated(self, wish: Wish) -> bool:
        return self._closed or self._wish is None or self._wish.rendered != wish.rendered

    def _out(self, painted: Painted) -> None:
        self.latest, self._rate = painted, painted.rate
        if not painted.wish.denoise or painted.coarse:
            painted.result.denoised = None
            painted.result.metadata.pop("denoised", None)
        elif not self._denoised(painted):
            return
        self._show(painted)

    def _denoised(self, painted: Painted) -> bool:
        """Denoise a picture, without guides, as long as that leaves time to render; whether it was."""
        started = time.perf_counter()
        if started < self._clean_due and not painted.is_last:
            return False
        painted.result.denoise()
        now = time.perf_counter()
        self._clean_due = now + CLEAN_PACE * (now - started)
        return True

    def _coarse_sizes(self) -> Iterator[tuple[int, int]]:
        """At first what takes no longer than a picture in motion may, then twice as wide, and so on."""
        width, height = self.subject.size
        most = self._rate * MOVING_SECONDS if math.isfinite(self._rate) else 0.0
        fitting = (divisor for divisor in COARSER if width * height <= most * divisor**2)
        divisor = next(fitting, COARSER[-1])
        while divisor > 1 and min(width, height) >= SMALLEST * divisor:
            yield width // divisor, height // divisor
            divisor //= 2
