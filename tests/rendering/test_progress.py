"""Progress: what is left, whichever of samples and time ends the render first."""

from __future__ import annotations

import io
import math

import pytest
from rich.console import Console

from clvol.base.progress import Glance, Progress, RichProgress, format_noise, format_samples, format_seconds


class Seen:
    """A picture of which only the noise is looked at."""

    image = None

    def __init__(self, noise: float) -> None:
        self.noise = noise


def at_noise(noise: float) -> Glance:
    return Glance(lambda: Seen(noise), print)


def test_time_left_follows_the_pace_of_the_samples() -> None:
    record = Progress(samples_done=16, samples_total=64, seconds=8.0)
    assert record.fraction == 0.25
    assert record.seconds_left == 24.0


def test_time_left_is_what_the_time_limit_leaves_if_that_comes_first() -> None:
    assert Progress(10, None, 3.0, time_limit=12.0).seconds_left == 9.0
    both = Progress(samples_done=10, samples_total=1000, seconds=3.0, time_limit=4.0)
    assert both.seconds_left == 1.0
    assert both.fraction == 0.75
    assert Progress(10, None, 13.0, time_limit=12.0).seconds_left == 0.0


def test_nothing_is_claimed_before_the_first_sample() -> None:
    record = Progress(samples_done=0, samples_total=64, seconds=2.0)
    assert record.fraction == 0.0
    assert math.isnan(record.seconds_left) and math.isnan(record.noise)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "1 s"), (59.0, "59 s"), (125.0, "2:05"), (3725.0, "1:02:05"), (math.nan, "-")]
)
def test_durations_are_short(seconds: float, text: str) -> None:
    assert format_seconds(seconds) == text


def test_noise_is_a_percentage_or_unknown() -> None:
    assert format_noise(0.01234) == "1.2 %"
    assert format_noise(2.5) == "250 %"
    assert format_noise(math.nan) == "unknown"


def test_samples_name_the_total_where_there_is_one() -> None:
    assert format_samples(Progress(12, 64, 1.0)) == "12/64 spp"
    assert format_samples(Progress(12, None, 1.0, 5.0)) == "12 spp"


def test_bar_shows_samples_time_left_and_noise_on_a_terminal() -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100)
    with RichProgress(console) as progress:
        progress(Progress(16, 64, 8.0, glance=at_noise(0.012)))
        progress._bar.refresh()
    assert "16/64 spp  24 s left  noise 1.2 %" in screen.getvalue()


def test_bar_is_silent_where_there_is_no_terminal() -> None:
    screen = io.StringIO()
    with RichProgress(Console(file=screen, force_terminal=False)) as progress:
        progress(Progress(16, 64, 8.0))
    assert screen.getvalue() == ""
