"""How often the host waits for the device, and that the device does not rest meanwhile."""

import math
from contextlib import suppress
from itertools import product

import numpy as np
import pyopencl as cl
import pytest
from every_bit import scene

import clvol
from clvol import layout
from clvol.planning.choices import Choices
from clvol.planning.plan import Plan
from clvol.rendering import launches, wavefront
from clvol.rendering.launches import Launches
from clvol.rendering.outcome import make_result
from clvol.rendering.profiler import Profiler
from clvol.rendering.session import Session


def session_of(device, monkeypatch, profiler=None, batch_seconds=1e-4):
    monkeypatch.setattr(wavefront, "_HARVEST_SECONDS", math.inf)
    for module in (launches, wavefront):
        monkeypatch.setattr(module, "BATCH_SECONDS", batch_seconds)
    plan = Plan.of(scene(), Choices(majorant="grid"))
    return Session.for_plan(device, scene(), plan, seed=1, pool=256, profiler=profiler)


def test_a_wave_is_queued_behind_what_the_host_waits_for(device, monkeypatch):
    """Copies that block are those that begin a round: after them, the device always has a wave to run."""
    session = session_of(device, monkeypatch)
    batch, copy, seen = Launches.batch, cl.enqueue_copy, {"batches": 0, "waits": 0}

    def watched(self, kernels, waves, ahead):
        found = batch(self, kernels, waves, ahead)
        assert ahead and len(self._waves) == 1
        seen["batches"] += 1
        return found

    def copied(*arguments, is_blocking=True, **keywords):
        seen["waits"] += is_blocking
        return copy(*arguments, is_blocking=is_blocking, **keywords)

    monkeypatch.setattr(Launches, "batch", watched)
    monkeypatch.setattr(cl, "enqueue_copy", copied)
    session.run(0, 64)
    assert seen["batches"] > 8
    assert seen["waits"] == 5


def paths_in_flight(session):
    """Slots that hold a path."""
    runs = session.wavefront
    row = [field.name for field in runs.fields].index("job")
    jobs = runs._read("state", np.empty(runs.stride, np.uint32), 4 * runs.stride * row)
    return int((jobs[: runs.pool.slots] != layout.NO_JOB).sum())


def test_an_end_finishes_the_passes_that_waves_ahead_have_begun(device, monkeypatch):
    """The host's counters are older than they are; wherever the end is asked for, no path is left over."""
    session, ends = session_of(device, monkeypatch), set()
    batch, more = Launches.batch, iter(range(1 << 30))

    def far_ahead(self, kernels, waves, ahead):
        found = batch(self, kernels, waves, ahead)
        for _ in range(next(more) % 4 if ahead else 0):
            self._queue_wave(kernels)
        return found

    monkeypatch.setattr(Launches, "batch", far_ahead)
    for pass_samples, asked_after in product((4, 8, 16), (1, 2, 3, 5, 8, 13, 21)):
        session.wavefront.pass_samples = pass_samples  # passes begin in every wave or so
        asked = iter(range(asked_after))
        session.restart(1)
        done = session.run(0, 1 << 20, None, lambda asked=asked: next(asked, None) is None)
        assert 0 < done < 1 << 20
        assert paths_in_flight(session) == 0
        assert session.run(done, 3) == 3
        ends.add(done)
        image, spp = make_result(session, 0, done + 3).image, done + 3
        session.restart(1)
        session.run(0, spp)
        assert (make_result(session, 0, spp).image == image).all()
    assert len(ends) > 8


@pytest.mark.parametrize("profiled", [False, True])
def test_a_device_that_fails_leaves_no_path_to_the_next_render(device, monkeypatch, profiled):
    """Two waits in a row fail, also the one for what is queued: slots begin anew, nothing is booked twice."""
    profiler = Profiler() if profiled else None
    session = session_of(device, monkeypatch, profiler)
    session.wavefront.pass_samples = 4
    session.run(0, 64)
    expected = make_result(session, 0, 64).image
    wait, left, kernel = cl.Event.wait, [0], session.wavefront.kernels["accumulate"]

    def failing(event):
        left[0] -= 1
        if left[0] in (0, -1):
            cl.enqueue_nd_range_kernel(
                device.queue, kernel, (0,) * 5, (1,) * 5
            )  # raises an error of OpenCL's
        return wait(event)

    for at in (1, 2, 7, 12):
        session.restart(1)
        left[0] = at
        monkeypatch.setattr(cl.Event, "wait", failing)
        with pytest.raises(clvol.DeviceError):
            session.run(0, 64)
        monkeypatch.setattr(cl.Event, "wait", wait)
        session.restart(1)
        session.run(0, 64)
        assert (make_result(session, 0, 64).image == expected).all()
        assert not session.wavefront.launched._waves


def test_what_is_shown_of_a_render_has_been_counted(device, monkeypatch):
    """A frame's statistics hold the passes that are in its picture, and every wave."""
    session = session_of(device, monkeypatch)
    session.wavefront.pass_samples = 4
    launched, stages = session.wavefront.launched, len(session.plan.stages)
    for done in session.passes(0, 64, None, lambda: 0):
        stats = make_result(session, 0, done).stats
        assert stats["launches"] == launched.waves * stages + done // 4
        assert stats["seconds"]["accumulate"] > 0
        assert not launched._waves


def test_an_end_that_drops_nothing_warns_of_nothing(device, monkeypatch, caplog):
    """The batch in which it is asked for ends all that has begun."""
    session = session_of(device, monkeypatch, batch_seconds=1.0)
    session.wavefront.pass_samples = 16
    for asked_after in range(1, 10):
        asked = iter(range(asked_after))
        session.restart(1)
        with suppress(KeyboardInterrupt):  # where none has ended yet
            session.run(0, 1 << 20, None, lambda asked=asked: 2 * (next(asked, None) is None))
    assert "dropped 0" not in caplog.text
