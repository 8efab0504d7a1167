"""Films that have no room on their device, rendered in bands of whole rows, one after the other.

Everything but the film is as it is for one that has room: the scene, the plan, the camera of the whole
picture, and the numbers of pixels, which random numbers are drawn by.  Only their places in the film's
buffers count from the first pixel of the band (`first_pixel` of the Render record).  So the picture has the
bits that a device with more memory gives.

Every pixel is to have the same samples whenever the render ends: it goes over all bands in *rounds* of
samples.  The sums go back and forth between host and device without loss, and a round that does not come to
its end is as if it had never begun.
"""

from __future__ import annotations

import logging
import math
import time
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pyopencl as cl

from clvol import layout
from clvol.rendering.banded_film import BandedFilm
from clvol.rendering.patience import Patience
from clvol.rendering.profiler import timed
from clvol.rendering.wavefront import Wavefront

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

log = logging.getLogger("clvol")
_NON_FINITE = layout.enum("COUNTER", "NON_FINITE")
_ROUND_SECONDS = 5.0
"""A round takes half as long or more, if there are enough samples: Ctrl-C waits for about that."""
_MOVING_SHARE = 0.05
"""Of a round, that sums may take to and from the device: where it is more, rounds have more samples."""


class BandedWavefront(Wavefront):
    """A wavefront whose device holds `held` pixels of the film at a time."""

    film: BandedFilm

    _listed: np.ndarray | None = None

    def new_film(self, seed: tuple[int, int]) -> BandedFilm:
        """An empty film for samples of another seed."""
        return BandedFilm(self.device, self.plan, self.pixels, seed, self.held)

    def list_pixels(self, pixels: np.ndarray | None) -> None:
        """What the next run renders, as on a device with room: pixels, in any order, or None for all."""
        chosen = np.arange(self.pixels) if pixels is None else np.sort(pixels)
        self._listed = self._entries(chosen)

    def _bands(self) -> Iterator[tuple[int, int, np.ndarray | None]]:
        """First pixel of each band, how many it has, and entries of its list, numbered from the first on."""
        for first in range(0, self.pixels, self.held):
            count = min(self.held, self.pixels - first)
            if self._listed is None:
                yield first, count, self._entries(np.arange(first, first + count))
                continue
            start, end = np.searchsorted(self._listed[:, 0], (first, first + count))
            if end > start:
                yield first, count, self._listed[start:end]

    def passes(
        self,
        first: int,
        count: int,
        should_stop: Callable[[], int],
        seconds_left: Callable[[], float] = lambda: math.inf,
    ) -> Iterator[int]:
        """As of a film that has room, but that passes are rounds; `seconds_left` bounds how long they are."""
        done, step, patience = 0, 1, Patience()
        while done < count and not (done and should_stop()):
            step, started = min(step, count - done), time.perf_counter()
            left = partial(self._urgency, patience, should_stop, done > 0)
            moving = self._round_of_bands(first + done, step, left)
            if moving is None:
                if should_stop() <= 2:
                    log.warning("dropped an unfinished round of %d samples a pixel over the bands", step)
                return
            done += step
            yield done
            spent = time.perf_counter() - started
            if spent < _ROUND_SECONDS / 2 or moving > _MOVING_SHARE * spent:
                step *= 2
            affordable = seconds_left() / max(spent / step, 1e-9)
            step = max(1, int(min(step, affordable)))

    @staticmethod
    def _urgency(patience: Patience, should_stop: Callable[[], int], some_finished: bool) -> int:
        """A round is finished, as passes are, or given up at once."""
        return 3 if patience.ends(should_stop(), some_finished) else 0

    def _round_of_bands(self, first: int, count: int, urgency: Callable[[], int]) -> float | None:
        """Give all pixels listed so many samples: the seconds that sums were moved for.

        None, and nothing has changed, where paths were not to be waited for any longer.
        """
        self._harvest()
        totals, non_finite = dict(self.film.slot_totals), self.non_finite()
        film, moving, whole = self.film, 0.0, False
        try:
            for at, pixels, entries in self._bands():
                moving += self._moved(film.bring(at, pixels))
                if entries is None:
                    self._list(pixels)
                else:
                    self._list(len(entries), entries - np.array([at, 0], np.uint32))
                done = 0
                for done in super().passes(first, count, urgency):  # noqa: B007
                    pass
                if done < count:
                    return None
                moving += self._moved(film.fetch(pixels))
            film.keep()
            whole = True
            return moving
        finally:
            film.forget()
            if not whole:
                with suppress(cl.Error):  # a device that is lost has counted nothing
                    self._harvest()
                    self._set_counter(_NON_FINITE, non_finite)
                film.slot_totals.update(totals)

    def _moved(self, copies: Iterator[tuple[cl.Event, int]]) -> float:
        """Book copies between host and device: the seconds that they took."""
        started = time.perf_counter()
        with timed(self.profiler, "bands"):
            for event, size in copies:
                self._copied(event, size)
        return time.perf_counter() - started
