"""Rendering to a target error: samples go where the error is, and end when it is small enough.

A survey with a seed of its own tells how noisy each pixel is.  It alone decides how many samples a pixel gets
and when to stop: none of these decisions has to do with the values of the samples in the picture, which
therefore stays unbiased (Kirk and Arvo 1991, "Unbiased sampling techniques for image synthesis").
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from clvol.base.progress import Glance, Progress, ProgressCallback
from clvol.picture.result import relative_noise
from clvol.rendering.doubts import say_missed_target
from clvol.rendering.outcome import make_result
from clvol.rendering.session import MAX_SAMPLES, Session, nothing_finished, seed_words

if TYPE_CHECKING:
    from collections.abc import Iterator

    from clvol.picture.result import Result
    from clvol.rendering.film import Film

log = logging.getLogger("clvol")

CHUNK = 8
"""Independent samples are given out in multiples of so many."""
LEAST = 16
"""No pixel gets fewer, but for a lower cap, nor the first survey."""
BLIND = 256
"""Samples a pixel after which a survey that saw no light gives up: light may be rare."""
SURVEY_SHARE = 8
"""The picture has at most so many times the survey's samples, lest a survey too short decide on too many."""
SURVEY_GROWTH = 4
"""Each survey has at most so many times the samples of the one before, lest it take all of a time limit."""
_SMOOTHED = 5
"""Edge, in pixels, of the square that a pixel's variance is averaged over: single ones are rough."""
SURVEY_SEED = 0x9E3779B97F4A7C15
"""Added to the seed of the picture for the survey's."""
_HALVINGS = 16
"""Of the interval in which a factor is sought: to 5 digits."""

Rounding = Callable[[np.ndarray], np.ndarray]
"""Numbers of samples, float, to those that are given out, int64 and no smaller."""


def chunks(samples: np.ndarray) -> np.ndarray:
    """Up to multiples of CHUNK; int64."""
    whole: np.ndarray = np.ceil(np.minimum(samples, MAX_SAMPLES // 2) / CHUNK)
    return CHUNK * whole.astype(np.int64)


def powers_of_two(samples: np.ndarray) -> np.ndarray:
    """Up to powers of two, for low-discrepancy samples: others are noisier than half as many; int64."""
    powers: np.ndarray = 2 ** np.ceil(np.log2(np.clip(samples, 1, MAX_SAMPLES // 2))).astype(np.int64)
    return powers


def optimum(noise: np.ndarray, allowed: float, least: float = LEAST) -> np.ndarray:
    """Fewest samples in all that keep Σ noise / √samples within `allowed`; float64 (pixels,).

    Parameters
    ----------
    noise : float (pixels,)
        Standard deviation of one sample, summed over the channels.
    allowed : float
        Bound of the sum of the pixels' standard errors.
    least : float
        No pixel gets fewer.

    Returns
    -------
    Not rounded; inf where no number is enough.  Lagrange: samples in proportion to noise^(2/3), but for those
    at `least`.
    """
    noise = np.asarray(noise, float)
    share = noise ** (2 / 3)
    free = share > 0
    samples = np.where(free, np.inf, float(least))
    while free.any():
        rest = allowed - float((noise[~free] / np.sqrt(samples[~free])).sum())
        if rest <= 0:  # by rounding, or nothing was allowed
            break
        with np.errstate(over="ignore"):
            samples[free] = share[free] * (share[free].sum() / rest) ** 2
        low = free & (samples < least)
        samples[low] = least
        free &= ~low
        if not low.any():
            break
    return samples


def allocate(
    noise: np.ndarray, allowed: float, least: float = LEAST, rounding: Rounding = chunks
) -> np.ndarray:
    """The `optimum` in numbers that can be given out, a little scaled down while the bound is kept; int64."""
    best = optimum(noise, allowed, least)

    def scaled(factor: float) -> np.ndarray:
        return rounding(np.maximum(factor * best, least))

    return scaled(_change(lambda factor: (noise / np.sqrt(scaled(factor))).sum() > allowed)[1])


def capped(wanted: np.ndarray, have: np.ndarray, mean: int, rounding: Rounding = chunks) -> np.ndarray:
    """In proportion to `wanted`, but with at most `mean` samples on the mean; both (pixels,), returns int64.

    No pixel gets less than it has; if it has none, than a chunk, or the power of two below `mean` if that is
    less.
    """
    least = np.where(have > 0, have, 1 << (min(mean, CHUNK).bit_length() - 1))
    wanted = wanted * (mean / wanted.mean())  # rounding raises it: a factor below 1 is sought

    def scaled(factor: float) -> np.ndarray:
        return np.maximum(least, rounding(factor * wanted) if factor else 0)

    return scaled(_change(lambda factor: scaled(factor).mean() <= mean)[0])


def _change(before: Callable[[float], bool]) -> tuple[float, float]:
    """Factors from 0 to 1 close to each other, between which `before`, true from 0 on, becomes false."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if before(middle) else (low, middle)
    return low, high


@dataclass(frozen=True)
class TargetProgress(Progress):
    """How far a render to a target error is; the time left is that of the surveys too.

    Parameters
    ----------
    survey : (int, int)
        Samples per pixel of the survey: finished so far, and expected in all.
    """

    survey: tuple[int, int] = (0, 0)

    @property
    def _work(self) -> Progress:
        total = None if self.samples_total is None else self.samples_total + self.survey[1]
        return Progress(self.samples_done + self.survey[0], total, self.seconds, self.time_limit)

    @property
    def fraction(self) -> float:
        """Share of the work that is done, 0..1, by samples or by time, whichever ends the render first."""
        return self._work.fraction

    @property
    def seconds_left(self) -> float:
        """Estimated seconds to the end, at the pace so far; nan while nothing is known."""
        return self._work.seconds_left


class TargetRender:
    """A session's way to a target error."""

    def __init__(self, session: Session, target: float, most: int | None) -> None:
        self.session, self.target, self.most = session, target, most
        self.wavefront = session.wavefront
        self.picture = self.wavefront.film
        self.survey = self.wavefront.new_film(seed_words((session.seed + SURVEY_SEED) % 2**64))
        self.low_discrepancy = bool(session.plan.randomizations)
        self.rounding = powers_of_two if self.low_discrepancy else chunks
        self.expected: float | None = None
        """Mean of the samples that the picture will have, by the last plan."""
        self.noise, self.level = np.zeros(self.wavefront.pixels), 0.0
        """By the last survey: standard deviation of a sample of each pixel, and the sum of the radiance."""

    def run(
        self,
        time_limit: float | None,
        callback: ProgressCallback | None,
        interrupted: Callable[[], int],
    ) -> int:
        """Render until the survey says that the error is below the target; return the mean of the samples."""
        mean = 0
        for mean in self.steps(time_limit, callback, interrupted):  # noqa: B007
            pass
        return mean

    def steps(
        self,
        time_limit: float | None,
        callback: ProgressCallback | None,
        interrupted: Callable[[], int],
    ) -> Iterator[int]:
        """As `run`, and stop whenever the picture, which the session then shows, has more samples."""
        self.started = time.perf_counter()
        self.time_limit, self.callback, self.interrupted = time_limit, callback, interrupted
        everywhere, final = np.ones(self.wavefront.pixels, np.int64), False
        while not (final or self._stopped()):
            self._add(self.survey, self._next_survey() * everywhere)
            if not self._stopped():
                plan, final = self._plan()
                self._add(self.picture, plan.min() * everywhere)  # an early end leaves no pixel without
                self._add(self.picture, plan)
                if not final and self.picture.samples.all():
                    yield self._mean_samples()
        if not self.picture.samples.all():  # not even the survey was finished in time
            self._add(self.picture, CHUNK * everywhere)
        if not self.picture.samples.all():
            raise nothing_finished(self.interrupted())
        self.wavefront.use_film(self.picture)
        self._report_end()
        yield self._mean_samples()

    def _mean_samples(self) -> int:
        self.session.seconds = time.perf_counter() - self.started
        return round(float(self.picture.samples.mean()))

    def _next_survey(self) -> int:
        """How many samples it is to have."""
        before = int(self.survey.samples[0])
        if before == 0:
            return LEAST
        wanted = np.clip((self.expected or 0) / SURVEY_SHARE, 2 * before, SURVEY_GROWTH * before)
        return int(self.rounding(wanted))

    def _plan(self) -> tuple[np.ndarray, bool]:
        """How many samples each pixel is to have, and whether that reaches the target or the most allowed."""
        width, height = self.session.prepared.scene.film.window[2:]
        mean, variance = self.survey.uneven_estimate().mean_and_variance()
        count, have = int(self.survey.samples[0]), self.picture.samples
        self.level = float(np.abs(mean).sum())
        self.noise = np.sqrt(_smoothed(variance * count, width, height)).sum(axis=1)
        most = np.inf if self.most is None else self.most
        if self.level == 0.0:
            final = count >= min(BLIND, most)
            if final:
                log.warning(
                    "the survey of the target error saw no light in %d samples a pixel: none gets over %d",
                    count,
                    LEAST,
                )
            return np.full(len(have), min(LEAST, most), np.int64), final
        # fewer low-discrepancy samples than the survey's may be noisier than its law, variance / n, says
        least = max(LEAST, count) if self.low_discrepancy else LEAST
        allowed = self.target * self.level
        plan = np.maximum(allocate(self.noise, allowed, least, self.rounding), have)
        self.expected = min(float(plan.mean()), most)
        mean_now = min(self.expected, SURVEY_SHARE * count)
        if plan.mean() > mean_now:
            ideal = np.minimum(optimum(self.noise, allowed, least), 1e200)  # of which a mean can be taken
            plan = capped(ideal, have, int(mean_now), self.rounding)
        final = mean_now == self.expected
        if final:
            self.expected = float(plan.mean())
        return plan, final

    def _add(self, film: Film, goal: np.ndarray) -> None:
        """Render what the film's pixels lack of `goal`; in runs of equal length, the longest first.

        An early end leaves out what is left, but for a first pass where pixels have no sample yet.
        """
        self.wavefront.use_film(film)
        lacking = np.maximum(goal - film.samples, 0)
        for bit in reversed(range(int(lacking.max(initial=0)).bit_length())):
            pixels = np.flatnonzero(lacking >> bit & 1)
            if film.samples.all() and self._stopped():
                return
            if len(pixels):
                self.wavefront.list_pixels(pixels)
                had = film.samples[pixels]
                for done in self.wavefront.passes(0, 1 << bit, self._stopped):
                    film.samples[pixels] = had + done
                    self._tell(film, goal)

    def _stopped(self) -> int:
        late = self.time_limit is not None and time.perf_counter() - self.started >= self.time_limit
        return max(late, self.interrupted())

    def _tell(self, film: Film, goal: np.ndarray) -> None:
        """Report that samples are finished."""
        if self.callback is None:
            return
        done, expected = int(self.picture.samples.mean()), self.expected
        survey = int(self.survey.samples.min())
        surveys = max(survey, int((expected or 0) / SURVEY_SHARE))
        if film is self.survey:
            surveys = max(surveys, int(goal[0]))
        with Glance(self._so_far, self.callback) as glance:
            self.callback(
                TargetProgress(
                    done,
                    None if expected is None else max(int(expected), done),
                    time.perf_counter() - self.started,
                    self.time_limit,
                    "rendering" if film is self.picture else "survey",
                    glance,
                    (survey, surveys),
                )
            )

    def _so_far(self) -> Result | None:
        """The picture, whatever film is rendered to; None while it has no samples."""
        if not self.picture.samples.all():
            return None
        film = self.wavefront.film
        self.wavefront.use_film(self.picture)
        result = make_result(self.session, 0, self._mean_samples(), final=False)
        self.wavefront.use_film(film)
        return result

    def _report_end(self) -> None:
        estimate = self.picture.uneven_estimate()
        noise = relative_noise(*estimate.mean_and_variance(), estimate.dof)
        counts = self.picture.samples
        log.info(
            "target error %.3g: noise %.3g; %d to %d samples a pixel, %.4g on the mean; survey %d",
            self.target,
            noise,
            counts.min(),
            counts.max(),
            counts.mean(),
            self.survey.samples[0],
        )
        say_missed_target(noise, self.target)


def _smoothed(variance: np.ndarray, width: int, height: int) -> np.ndarray:
    """Mean over each pixel's surroundings; (pixels, channels)."""
    from scipy.ndimage import uniform_filter

    picture = np.nan_to_num(variance, posinf=0.0).reshape(height, width, -1)
    smooth = uniform_filter(picture, (_SMOOTHED, _SMOOTHED, 1), mode="nearest")  # may round below 0
    positive: np.ndarray = np.maximum(smooth, 0.0)
    return positive.reshape(variance.shape)
