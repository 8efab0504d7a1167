"""Renders that nothing would end: walks go in legs from wave to wave, and an early end drops what has no end.

Statistical tests compare two renders of independent samples at fixed seeds, false-alarm rate 1e-4 each.
"""

import contextlib
import hashlib
import math
import subprocess
import sys

import pytest
from long_walks import endless, scene_of
from stat_tests import assert_same_picture
from tiers import quick_first

import clvol
from clvol.planning.choices import Choices
from clvol.planning.lanes import lanes
from clvol.rendering import patience
from clvol.rendering.outcome import make_result
from clvol.rendering.session import Session

WALK_STEPS, STAGE_STEPS = 1 << 12, 1 << 13
CASES = (
    ("lumps", "delta", "ratio"),
    ("lumps", "weighted-decomposition", "residual-ratio"),
    ("lumps", "regular", "regular"),
    ("overlap", "delta", "delta"),
    ("overlap", "spectral-decomposition", "ratio"),
    ("sheets", "spectral", "residual-ratio"),
)


def digest(result):
    return hashlib.sha256(result.image.tobytes() + result.variance.tobytes()).hexdigest()


@pytest.mark.contract
@pytest.mark.parametrize(("kind", "technique", "transmittance"), CASES)
def test_walks_in_short_legs_give_the_same_picture(bounds, kind, technique, transmittance):
    """One step a leg, or four pieces between planes: nearly every walk goes on in later waves."""
    options = {"technique": technique, "transmittance": transmittance, "majorant": "grid"}
    scene = scene_of(kind)
    whole = clvol.render(scene, spp=1024, seed=1, **options)
    bounds(WALK_STEPS=4 if technique == "regular" else 1, STAGE_STEPS=20)
    cut = clvol.render(scene, spp=1024, seed=2, **options)
    assert cut.stats["walks_exhausted"] == 0
    assert_same_picture(whole, cut)


@pytest.mark.contract
def test_legs_do_not_depend_on_how_waves_are_cut(bounds):
    """Slots that a stage leaves to the next wave keep their bits."""
    scene = scene_of("sheets")
    whole = clvol.render(scene, spp=64, seed=1)
    bounds(STAGE_STEPS=1)
    assert digest(clvol.render(scene, spp=64, seed=1)) == digest(whole)


def test_a_walk_is_given_up_after_its_last_leg(bounds):
    bounds(WALK_STEPS=2, WALK_LEGS=4)
    result = clvol.render(scene_of("lumps"), spp=8, majorant_scale=20.0)
    assert result.stats["walks_exhausted"] > 0


def session_of(device, kind, pool=256):
    choices = Choices(majorant_scale=3e7 if kind == "majorant" else 1.0)
    scene = scene_of(kind) if kind in ("lumps", "sheets") else endless(kind)
    return Session.for_scene(device, scene, choices, 1, pool)


def levels(*changes):
    """Says how urgently the end is asked for: level n from call changes[n - 1] on."""
    calls = [0]

    def level():
        calls[0] += 1
        return sum(calls[0] > change for change in changes)

    level.calls = calls
    return level


@quick_first("kind", ["voxel", "majorant", "albedo"])
def test_the_host_is_asked_after_a_bounded_number_of_steps(device, kind):
    """No launch is longer than a stage's bound and a leg of each walk at hand, in both tracking stages."""
    session = session_of(device, kind)
    runs, plan = session.wavefront, session.plan
    least = levels(8, 12)
    before, most = [0, 0], [0.0]

    def ask():
        after = [runs.slot_statistics()["tentative"], runs.launched.waves]
        waves = after[1] - before[1]
        if waves:
            most[0] = max(most[0], (after[0] - before[0]) / waves)
        before[:] = after
        return least()

    with contextlib.suppress(KeyboardInterrupt):  # raised where no pass was finished
        session.run(0, 1 << 20, None, ask)
    items = runs.groups * plan.tuning.local_size
    at_hand = max(lanes(plan).values(), default=1)
    assert 0 < most[0] <= 2 * items * (STAGE_STEPS + at_hand * WALK_STEPS)
    assert least.calls[0] < 30


@pytest.mark.contract
def test_a_second_interrupt_keeps_finished_passes_and_leaves_nothing_behind(device):
    session = session_of(device, "sheets", pool=None)
    finished = []

    for done in session.passes(0, 1 << 20, None, lambda: 2 if finished else 0):
        finished.append(done)
    assert done == finished[-1] > 0
    cut = make_result(session, 0, done)
    session.restart(1)
    assert session.run(0, done) == done
    assert digest(make_result(session, 0, done)) == digest(cut)


def test_a_time_limit_ends_paths_without_end(monkeypatch):
    for name in ("PATIENCE_SECONDS", "FIRST_PATIENCE_SECONDS"):
        monkeypatch.setattr(patience, name, 0.01)
    with pytest.raises(clvol.RenderError, match="go on for very long"):
        clvol.render(endless("majorant"), time_limit=0.01, majorant_scale=3e7)


def test_ctrl_c_ends_walks_without_end():
    """In a process of its own, which the limit kills if nothing else ends it."""
    code = """
import os, signal, sys
sys.path[:0] = {path!r}
signal.signal(signal.SIGINT, signal.default_int_handler)
import clvol
from long_walks import endless
from clvol.rendering.launches import Launches
batch, calls = Launches.batch, []
def counted(self, kernels, waves, ahead):
    calls.append(waves)
    if len(calls) in (4, 6):
        os.kill(os.getpid(), signal.SIGINT)
    return batch(self, kernels, waves, ahead)
Launches.batch = counted
try:
    clvol.render(endless("majorant"), majorant_scale=3e7)
except KeyboardInterrupt:
    print("ended after", len(calls))
"""
    here = [p for p in sys.path if p]
    run = subprocess.run(
        [sys.executable, "-c", code.replace("{path!r}", repr(here))],
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert run.stdout.startswith("ended after"), run.stderr


def test_noise_shown_is_that_of_the_picture_so_far():
    shown = []
    result = clvol.render(scene_of("lumps"), spp=256, seed=1, pool=256, progress=shown.append)
    noises = [record.noise for record in shown]
    assert len(noises) > 10
    assert noises[-1] == pytest.approx(result.noise, rel=1e-6)
    for record in shown[4:]:  # by the law of the noise, which the first passes know to some percent
        law = result.noise * math.sqrt(256 / record.samples_done)
        assert record.noise == pytest.approx(law, rel=0.35)
