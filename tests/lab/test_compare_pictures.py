"""What a comparison's report begins with: pictures at equal time, their errors, that of one render."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from made_up_comparison import MadeUp, measured

from clvol.lab.comparison.entrants import Entrant, Render
from clvol.lab.comparison.equal_time import display, equal_time
from clvol.lab.comparison.html import html_report
from clvol.lab.comparison.measure import Effort, Measured, Rounds, equal_seconds
from clvol.lab.comparison.one_render import one_render
from clvol.lab.comparison.reference import Reference
from clvol.lab.comparison.relative import relative_weight

if TYPE_CHECKING:
    from clvol.lab.comparison.result import Comparison

SHAPE = 12, 10, 3


@pytest.fixture
def comparison() -> Comparison:
    return measured({"a": MadeUp(), "b": MadeUp(rate=4000)}, Effort(rounds=4, seconds=0.4))


def truth(variance: float = 0.01) -> Reference:
    """A picture from dark to bright, with a known error."""
    rounds = np.linspace(0.1, 2.0, np.prod(SHAPE)).reshape(SHAPE) + np.zeros((2, *SHAPE))
    reference = Reference.of_rounds(rounds.astype(np.float32), 64, "made up")
    return Reference(reference.image, np.full(SHAPE, variance), reference.rounds, 128, "made up")


class Slow:
    """A trial whose renders take `own` seconds a sample, though a trial told others."""

    def __init__(self, own: float) -> None:
        self.own, self.spp = own, []

    def render(self, seed: int, spp: int) -> SimpleNamespace:
        self.spp.append(spp)
        stats = {"seconds": {"render": spp * self.own}, "lookups": 1}
        return SimpleNamespace(image=np.zeros(SHAPE), stats=stats, metadata={"seed": seed})


def entrant(pace: float, spp: int, own: float | None = None) -> Entrant:
    return Entrant("a", Slow(own or pace), lambda label: None, spp=spp, pace=pace)


def test_pictures_take_as_long_as_a_round_and_a_sample_of_the_slowest() -> None:
    rounds = [entrant(0.01, 100), entrant(0.02, 64), entrant(0.5, 1)]
    assert equal_seconds(rounds) == pytest.approx(1.0)
    assert equal_seconds([*rounds, entrant(30.0, 1)]) == pytest.approx(30.0)
    assert [e.render_for(1.0, iter(range(9))).spp for e in rounds] == [100, 50, 2]


def test_a_picture_that_took_another_time_than_expected_is_rendered_once_more() -> None:
    late = entrant(0.01, 100, own=0.02)
    made = late.render_for(1.0, iter((7, 8)))
    assert late.trial.spp == [100, 50] and (made.spp, made.seconds, made.seed) == (50, 1.0, 8)
    assert entrant(0.01, 100, own=0.0105).render_for(1.0, iter((7,))).spp == 100


def test_the_error_of_a_picture_is_relative_and_without_that_of_the_reference() -> None:
    reference = truth()
    off = Render((reference.image + 0.3).astype(np.float32), 1.0, 1.0, 0, 4)
    weight = relative_weight(reference.image)
    found = equal_time(off, reference, weight)
    assert found.relrmse == pytest.approx(np.sqrt(((0.09 - 0.01) * weight).mean()), rel=1e-5)
    grey = reference.image.mean(axis=-1)
    floor = 0.1 * grey.mean()
    np.testing.assert_allclose(found.error, 0.3 / np.sqrt(grey**2 + floor**2), rtol=1e-5)


def test_flip_is_told_of_what_is_displayed() -> None:
    pytest.importorskip("flip_evaluator", reason="FLIP is an extra: pip install 'clvol[flip]'")
    reference = truth()
    same = equal_time(Render(reference.image, 1.0, 1.0, 0, 4), reference, np.ones(SHAPE))
    assert same.mean_flip == 0
    moved = reference.image.copy()
    moved[3, 7] += 1.0
    seen = equal_time(Render(moved, 1.0, 1.0, 0, 4), reference, np.ones(SHAPE))
    assert seen.flip.shape == SHAPE[:2] and 0 < seen.mean_flip < 1
    assert np.unravel_index(seen.flip.argmax(), SHAPE[:2]) == (3, 7)
    white = equal_time(Render(reference.image * 1e30, 1.0, 1.0, 0, 4), reference, np.ones(SHAPE))
    whiter = equal_time(Render(reference.image * 1e33, 1.0, 1.0, 0, 4), reference, np.ones(SHAPE))
    assert whiter.mean_flip == pytest.approx(white.mean_flip, abs=1e-3)


def test_what_is_not_finite_is_magenta_and_ends_no_report() -> None:
    reference, image = truth(), truth().image.astype(np.float32)
    image[0, 0, 1], image[1, 1, 0] = np.nan, np.inf
    assert display(image)[0, 0].tolist() == display(image)[1, 1].tolist() == [1, 0, 1]
    assert np.isnan(equal_time(Render(image, 1.0, 1.0, 0, 4), reference, np.ones(SHAPE)).relrmse)


def test_the_error_of_one_render_over_its_samples_holds_the_truth() -> None:
    """Of noise of variance 1 / spp around a reference that is exact."""
    random, reference = np.random.default_rng(3), truth(variance=0.0)
    weight = relative_weight(reference.image)

    def rounds(spp: int) -> Rounds:
        noise = random.standard_normal((12, *SHAPE)) / np.sqrt(spp)
        return Rounds(reference.image + noise, np.full(12, spp * 0.5), np.full(12, spp * 7.0))

    picture = Render(reference.image, 1.0, 1.0, 0, 16)
    measured = Measured("a", None, 16, *rounds(16), (0,) * 12, picture, (), {s: rounds(s) for s in (4, 1)})
    found = one_render(measured, reference, weight)
    assert found.spp.tolist() == [1, 4, 16]
    assert found.seconds.tolist() == [0.5, 2, 8] and found.lookups.tolist() == [7, 28, 112]
    exact = weight.mean() / found.spp
    assert (found.low < exact).all() and (exact < found.high).all()
    assert (found.high < 1.3 * exact).all()


def test_the_report_begins_with_pictures_then_errors_then_words(comparison) -> None:
    page = html_report(comparison, {"one_render_over_spp": b"", "efficiency": b""})
    heads = re.findall(r"<h2>(.*?)</h2>", page)
    assert heads[:3] == ["Pictures at equal time", "Error of one render", "What was found"]
    assert (
        page.index('id="reference"') < page.index('class="shown"') < page.index("one render over its samples")
    )
    for figures in comparison.figures:
        assert f"{figures.picture.render.spp} spp in " in page


def test_without_flip_the_report_says_what_brings_it(comparison) -> None:
    for figures in comparison.figures:
        vars(figures.picture)["flip"] = None
    page = html_report(comparison, {})
    assert "clvol[flip]" in page and "FLIP error of" not in page and "<th>FLIP</th>" not in page
