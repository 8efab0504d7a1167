"""`--technique auto:pilot`: what it picks, what it keeps, and that the picture owes its samples nothing.

The search runs on made-up candidates, whose variances and seconds are planted; one small scene runs for real.
"""

import functools
import logging
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from made_up_pilot import SKY, lumps, made_up, scene
from pictures import homogeneous

import clvol
from clvol.cli.main import main
from clvol.errors import OptionError
from clvol.lab import candidates
from clvol.lab import pilot as pilots
from clvol.lab.candidates import Candidate, Relative
from clvol.lab.combinations import unbiased
from clvol.lab.repeat import announcement, repeat_command, with_definitions
from clvol.lab.seeds import independent_seeds
from clvol.planning.choices import Choices

# -- made-up candidates ---------------------------------------------------------------------------


def test_both_kinds_of_seconds_are_of_the_same_clock(monkeypatch):
    """Processor seconds on a processor: what waits for other programs counts in neither."""
    now = {"process_time": 0.0, "perf_counter": 0.0}
    for name in now:
        monkeypatch.setattr(f"time.{name}", lambda name=name: now[name])

    def work(own, waiting):
        now["process_time"] += own
        now["perf_counter"] += own + waiting

    class Session(SimpleNamespace):
        setup_seconds, kernel_seconds = 4.0, 3.0
        plan = SimpleNamespace(in_force=dict.fromkeys(pilots.CHOSEN, "x"))
        image, stats = np.zeros((2, 2, 3)), {"largest_weight": 1.0}
        restart = lambda self, *_: self  # noqa: E731
        run = lambda *_: work(6.0, 50.0)  # noqa: E731

        @classmethod
        def open(cls, device, *_):
            work(8.0, 5.0)
            return cls(device=device)

    monkeypatch.setattr(pilots, "Session", Session)
    monkeypatch.setattr(candidates, "make_result", lambda session, *_: session)
    prepared = SimpleNamespace(under=lambda plan: None)
    monkeypatch.setattr(pilots, "prepare", lambda *_: work(3.0, 70.0) or prepared)
    device = SimpleNamespace(is_cpu=True, description="a device", info=SimpleNamespace(compute_units=2))
    run = pilots.Pilot(
        device, scene(lumps(), (SKY,)), Choices(), independent_seeds(0, "pilot"), 4, None, None
    )
    candidate = run._open(run.choices)
    candidate.render(1, 4)
    assert candidate.seconds == [3.0]  # two threads
    assert candidate.trial.precompute_seconds == pytest.approx(3.0 + 8.0 / 4)  # the rest built kernels


@functools.cache
def run_of_autos():
    return made_up(Choices())


def test_the_most_efficient_combination_is_found():
    found, run = run_of_autos()
    assert found.names == {
        "technique": "decomposition",
        "transmittance": "power-series",
        "majorant": "kdtree",
    }
    assert found.relative.low < 12 < found.relative.high
    labels = [candidate.label for candidate in run.candidates]
    assert len(set(labels)) == len(labels)
    assert not any("spectral" in label for label in labels)  # a grey scene: its kernels are weighted-delta's


def test_a_hopeless_candidate_costs_one_round():
    _, run = run_of_autos()
    hopeless = [c for c in run.candidates if c.label.startswith("regular")]
    assert [len(c.seconds) for c in hopeless] == [1]


def test_the_pilot_is_short():
    """Every family's candidates once, then half of them: less than twice their number, in each family."""
    _, run = run_of_autos()
    counts = [len(unbiased(family)) for family in pilots.CHOSEN]
    assert type(run).rendered <= 1 + pilots.ROUNDS * sum(2 * count + 3 for count in counts)
    assert run.seconds <= run.budget * 1.5


def test_a_choice_that_was_lucky_while_it_was_chosen_is_not_taken():
    """Twice as fast as auto's in the rounds that select, as fast in those that follow."""
    none = {family: {} for family in pilots.CHOSEN}
    lucky = lambda _, stage, auto: 1.0 if auto or stage == "final" else 0.5  # noqa: E731
    found, _ = made_up(Choices(), factors=none, slowness=lucky)
    if found.relative.value != 1.0:  # by noise, but not by what was lucky
        assert found.relative.high < 1.5
    steady, _ = made_up(Choices(), factors=none, slowness=lambda _, stage, auto: 1.0 if auto else 0.5)
    assert steady.relative.low > 1.5


def test_a_best_that_became_slow_is_still_there():
    """All the others far slower than auto's, from the second family on."""
    slow = lambda _, stage, auto: 1.0 if auto or stage == "technique" else 1000.0  # noqa: E731
    found, run = made_up(Choices(), slowness=slow)
    assert list(found.names.values()) == run.candidates[0].label.split(" + ")


def test_what_was_given_is_kept():
    found, run = made_up(Choices(transmittance="ratio", majorant="global"))
    assert found.names == {"technique": "decomposition", "transmittance": "ratio", "majorant": "global"}
    assert {c.trial.names["majorant"] for c in run.candidates} == {"global"}
    assert {c.trial.names["transmittance"] for c in run.candidates} == {"ratio"}


def test_autos_rules_stay_where_nothing_is_clearly_better():
    found, run = made_up(Choices(), factors={family: {} for family in pilots.CHOSEN})
    auto = run.candidates[0].label.split(" + ")
    if found.relative.value == 1.0:
        assert list(found.names.values()) == auto and "auto's own rules" in found.reason
    else:
        assert found.relative.value > pilots.WORTH


def test_impossible_combinations_are_no_candidates():
    _, run = made_up(Choices(lookup="stochastic"))
    assert not any("regular" in c.label for c in run.candidates)


def test_a_choice_that_may_be_no_better_is_not_taken():
    """Better by more than 5 % on the mean, but the interval of its ratio contains 1; certain, it is taken."""
    _, run = run_of_autos()
    auto, best = run.candidates[:2]
    for low, taken in ((0.95, False), (1.02, True)):
        found = run._report(best, auto, Relative(1.12, low, 1.31))
        assert (found.names == best.trial.names) is taken and ("stay" in found.reason) is not taken
        assert f"1.12 ({low} to 1.31)" in found.reason
    assert found.reason.count(" and ") == 1 and "majorants tried" in found.reason


def test_the_line_that_repeats_a_render_is_a_whole_command():
    lit = replace(scene(lumps(), (SKY,)), source="my scene.xml")
    line = repeat_command(lit, "--majorant grid", {"step": None, "aov": ("null", "real"), "spp": 7})
    line = with_definitions(line, {"name": "a b", "res": "32"})
    given = dict.fromkeys(pilots.CHOSEN, "auto") | {"majorant": "grid"}
    most = len(unbiased("technique")) + len(unbiased("transmittance")) - 1
    assert f"up to {most} combinations" in announcement(lit, given)
    assert line == (
        "clvol render 'my scene.xml' -o OUT.exr --majorant grid --aov null --aov real --spp 7 "
        "-D 'name=a b' -D res=32"
    )


# -- a render for real --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("extent", "option"), [({"spp": 4}, "--spp 4"), ({"samples": (2, 4)}, "--samples 2,4")]
)
def test_the_picture_is_that_of_the_choice_with_the_same_seed(caplog, monkeypatch, extent, option):
    """Seconds are planted, so that it is not auto's choice."""
    told, seeds = [], []
    original = Candidate.render

    def render(self, seed, spp):
        seeds.append(seed)
        original(self, seed, spp)
        self.seconds[-1] = 1.0 if self.label == "analytic + none + none" else 0.3

    monkeypatch.setattr(Candidate, "render", render)
    lit = scene(homogeneous(1.0, 0.5), (SKY,))
    with caplog.at_level(logging.INFO, "clvol"):
        found = clvol.render(lit, **extent, seed=9, technique="auto:pilot", progress=told.append)
    assert [record.what for record in told if record.what == "pilot"]
    about = found.metadata
    assert "--seed 9" in about["repeat"] and about["pilot"] in about["repeat"]
    assert "transmittance" in about["pilot_reason"] and "kernel builds" in about["pilot_reason"]
    assert about["pilot_reason"] in caplog.text and about["repeat"] in caplog.text
    assert about["repeat"].endswith(f" {option} --seed 9") and " -o OUT.exr " in about["repeat"]
    words = about["pilot"].split()
    assert words[0] == "--transmittance" and words[1] != "none"
    options = {name.removeprefix("--"): value for name, value in zip(words[::2], words[1::2], strict=True)}
    again = clvol.render(lit, **extent, seed=9, **options)
    assert np.array_equal(found.image, again.image) and np.array_equal(found.variance, again.variance)
    assert len(set(seeds)) == len(seeds) and 9 not in seeds


def test_a_pilot_before_a_render_to_a_target_error():
    sampler, lit = "independent", scene(homogeneous(1.0, 0.5), (SKY,))
    found = clvol.render(lit, seed=9, technique="auto:pilot", target_error=0.1, sampler=sampler)
    assert found.metadata["sampler"] == sampler and found.metadata["target_error"] == 0.1
    assert f"--sampler {sampler}" in found.metadata["repeat"] and found.noise < 0.15
    assert (
        "transmittances tried" in found.metadata["pilot_reason"]
        and "nan" not in found.metadata["pilot_reason"]
    )


def test_auto_pilot_is_a_technique_of_renders_alone(tmp_path):
    with pytest.raises(OptionError, match="unknown technique"):
        Choices(technique="auto:pilot")
    with pytest.raises(OptionError, match="unknown majorant"):
        clvol.render(scene(homogeneous(1.0), (SKY,)), majorant="auto:pilot")
    text = CliRunner().invoke(main, ["render", "--help"]).output
    assert "auto|auto:pilot|delta" in text.replace("\n", "").replace(" ", "")
