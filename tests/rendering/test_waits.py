"""How often the host waits for the device, and that the device does not rest meanwhile."""

import math
from itertools import product

import numpy as np
import pyopencl as cl
from every_bit import scene

from clvol import layout
from clvol.planning.choices import Choices
from clvol.rendering import launches, wavefront
from clvol.rendering.launches import Launches
from clvol.rendering.outcome import make_result
from clvol.rendering.session import Session


def session_of(device, monkeypatch):
    monkeypatch.setattr(wavefront, "_HARVEST_SECONDS", math.inf)
    monkeypatch.setattr(launches, "BATCH_SECONDS", 1e-4)
    return Session.for_scene(device, scene(), Choices(majorant="grid"), seed=1, pool=256)


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
