"""Rendering to a target error: samples go where the error is, and end when it is small enough.

A pilot with a seed of its own tells how noisy each pixel is.  It alone decides how many samples a pixel gets
and when to stop: none of these decisions has to do with the values of the samples in the picture, which
therefore stays unbiased (Kirk and Arvo 1991, "Unbiased sampling techniques for image synthesis").
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np

from clvol.film import Film
from clvol.progress import Progress, ProgressCallback
from clvol.result import relative_noise
from clvol.session import MAX_SAMPLES, Session, seed_words
from clvol.wavefront import Progressed

log = logging.getLogger("clvol")

CHUNK = 8
"""Samples are given out in multiples of so many."""
LEAST = 16
"""No pixel gets fewer, nor the first pilot."""
PILOT_SHARE = 8
"""The picture has at most so many times the pilot's samples, lest a pilot too short decide on too many."""
_SMOOTHED = 5
"""Edge, in pixels, of the square that a pixel's variance is averaged over: single ones are rough."""
_PILOT_SEED = 0x9E3779B97F4A7C15
"""Added to the seed of the picture for the pilot's."""


def allocate(noise: np.ndarray, allowed: float, least: int = LEAST) -> np.ndarray:
    """Samples of each pixel, multiples of CHUNK: fewest in all that keep Σ noise / √samples below `allowed`.

    Parameters
    ----------
    noise : float (pixels,)
        Standard deviation of one sample, summed over the channels.
    allowed : float
        Bound of the sum of the pixels' standard errors.
    least : int
        No pixel gets fewer.

    Returns
    -------
    int64 (pixels,).  Lagrange: samples in proportion to noise^(2/3), but for those at `least`.
    """
    share = np.asarray(noise, float) ** (2 / 3)
    free = share > 0
    samples = np.full(len(share), float(least))
    while free.any():
        fixed = float((noise[~free] / np.sqrt(samples[~free])).sum())
        if fixed >= allowed:
            break
        samples[free] = share[free] * (share[free].sum() / (allowed - fixed)) ** 2
        low = free & (samples < least)
        samples[low] = least
        free &= ~low
        if not low.any():
            break
    chunks = np.ceil(np.minimum(samples, MAX_SAMPLES // 2) / CHUNK)
    return (CHUNK * chunks).astype(np.int64)


class TargetRender:
    """A session's way to a target error."""

    def __init__(self, session: Session, target: float, most: int | None) -> None:
        self.session, self.target, self.most = session, target, most
        self.wavefront = session.wavefront
        self.picture = self.wavefront.film
        self.pilot = self.wavefront.new_film(seed_words((session.seed + _PILOT_SEED) % 2**64))

    def run(
        self,
        time_limit: float | None,
        callback: ProgressCallback | None,
        interrupted: Callable[[], bool],
    ) -> int:
        """Render until the pilot says that the error is below the target; returns the mean of the samples."""
        self.started = time.perf_counter()
        self.time_limit, self.callback, self.interrupted = time_limit, callback, interrupted
        self.goal = self.picture.samples
        while not self._stopped():
            grown = max(LEAST, 2 * int(self.pilot.samples[0]), int(self.goal.mean()) // PILOT_SHARE)
            self._add(self.pilot, np.full(self.wavefront.pixels, -(-grown // CHUNK) * CHUNK))
            plan, final = self._plan()
            self._add(self.picture, plan)
            if final or self._stopped():
                break
        if self.picture.samples.max() == 0:  # not even the pilot was finished in time
            self._add(self.picture, np.full(self.wavefront.pixels, LEAST), stoppable=False)
        self.wavefront.use_film(self.picture)
        self.session.seconds = time.perf_counter() - self.started
        self._report_end()
        return round(float(self.picture.samples.mean()))

    def _plan(self) -> tuple[np.ndarray, bool]:
        """How many samples each pixel is to have, and whether that reaches the target or the most allowed."""
        width, height = self.session.prepared.scene.film.window[2:]
        mean, variance = self.pilot.uneven_estimate().mean_and_variance()
        level, count = float(np.abs(mean).sum()), int(self.pilot.samples[0])
        noise = np.sqrt(_smoothed(variance * count, width, height)).sum(axis=1)
        if level == 0.0:
            log.warning("the pilot of the target error saw no light: every pixel gets %d samples", LEAST)
            return np.full(len(noise), LEAST), True
        plan = np.maximum(allocate(noise, self.target * level), self.picture.samples)
        most = PILOT_SHARE * count
        if self.most is not None and plan.mean() > self.most and self.most <= most:
            return _scaled(plan, self.most), True
        self.goal = plan
        return (plan, True) if plan.mean() <= most else (_scaled(plan, most), False)

    def _add(self, film: Film, goal: np.ndarray, stoppable: bool = True) -> None:
        """Render what the film's pixels lack of `goal`; in runs of equal length, the longest first."""
        self.wavefront.use_film(film)
        chunks = np.maximum(goal - film.samples, 0) // CHUNK
        for bit in reversed(range(int(chunks.max(initial=0)).bit_length())):
            pixels = np.flatnonzero(chunks >> bit & 1)
            if stoppable and self._stopped():
                return
            if len(pixels):
                self.wavefront.list_pixels(pixels)
                stop = self._stopped if stoppable else (lambda: False)
                film.samples[pixels] += self.wavefront.run(0, CHUNK << bit, stop, self._tell)

    def _stopped(self) -> bool:
        late = self.time_limit is not None and time.perf_counter() - self.started >= self.time_limit
        return late or self.interrupted()

    def _tell(self, _progressed: Progressed) -> None:
        if self.callback is None:
            return
        done = int(self.picture.samples.mean())
        total = max(int(self.goal.mean()), done) or None
        self.callback(Progress(done, total, time.perf_counter() - self.started, self.time_limit))

    def _report_end(self) -> None:
        estimate = self.picture.uneven_estimate()
        noise = relative_noise(*estimate.mean_and_variance(), estimate.dof)
        counts = self.picture.samples
        log.info(
            "target error %.3g: noise %.3g; %d to %d samples a pixel, %.4g on the mean; pilot %d",
            self.target,
            noise,
            counts.min(),
            counts.max(),
            counts.mean(),
            self.pilot.samples[0],
        )
        if not noise <= 1.05 * self.target:
            log.warning("the noise is %.3g, the target was %.3g", noise, self.target)


def _scaled(plan: np.ndarray, mean: int) -> np.ndarray:
    """The plan in proportion, with a mean of about `mean`, no pixel below a chunk; multiples of CHUNK."""
    return np.maximum(np.floor(plan * (mean / plan.mean()) / CHUNK), 1).astype(np.int64) * CHUNK


def _smoothed(variance: np.ndarray, width: int, height: int) -> np.ndarray:
    """Mean over each pixel's surroundings; (pixels, channels)."""
    from scipy.ndimage import uniform_filter

    picture = np.nan_to_num(variance, posinf=0.0).reshape(height, width, -1)
    smooth = uniform_filter(picture, (_SMOOTHED, _SMOOTHED, 1), mode="nearest")  # may round below 0
    return np.maximum(smooth, 0.0).reshape(variance.shape)
