"""How often the host waits for the device, which rests meanwhile."""

import math

import pyopencl as cl
from every_bit import scene

from clvol.planning.choices import Choices
from clvol.rendering import wavefront
from clvol.rendering.session import Session


def test_the_device_is_waited_for_once_a_batch(device, monkeypatch):
    session = Session.for_scene(device, scene(), Choices(majorant="grid"), seed=1, pool=256)
    launch, copy, seen = wavefront.Wavefront._launch, cl.enqueue_copy, {"batches": 0, "waits": 0}

    def batch(*arguments):
        seen["batches"] += 1
        return launch(*arguments)

    def copied(*arguments, is_blocking=True, **keywords):
        seen["waits"] += is_blocking
        return copy(*arguments, is_blocking=is_blocking, **keywords)

    monkeypatch.setattr(wavefront.Wavefront, "_launch", batch)
    monkeypatch.setattr(cl, "enqueue_copy", copied)
    monkeypatch.setattr(wavefront, "_HARVEST_SECONDS", math.inf)
    monkeypatch.setattr(wavefront, "_BATCH_SECONDS", 1e-4)
    session.run(0, 64)
    assert seen["batches"] > 8
    assert seen["waits"] == seen["batches"] + 5, "five begin a round"
