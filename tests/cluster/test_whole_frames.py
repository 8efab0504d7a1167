"""Whole pictures are tasks of a Dask cluster: each comes out once, with the bits that it has without one."""

import logging
import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
from dask_clusters import cluster, distributed
from every_bit import scene

import clvol
from clvol.api import sequence, whole
from clvol.api.sequence import Pictures
from clvol.cluster import on_worker

OPTIONS = {"spp": 8, "seed": 3, "sampler": "joint"}
COUNT = 5


def frame(number):
    """A frame is known by its seed."""
    return replace(scene(), seed=number, spp=8)


@pytest.fixture(scope="module")
def expected():
    options = {"sampler": "joint"}
    return [clvol.render(frame(n), **options) for n in range(COUNT)]


def gathered(client, urgency=lambda: 0, numbers=range(COUNT), scene_of=frame, **options):
    """What comes, by number; each once."""
    found = {}
    for number, result in Pictures(client, {"sampler": "joint", **options}, scene_of).results(
        numbers, urgency
    ):
        assert number not in found
        found[number] = result
    return found


def assert_all(found, expected):
    assert sorted(found) == list(range(len(expected)))
    for number, one in enumerate(expected):
        assert found[number].image.tobytes() == one.image.tobytes()
        assert found[number].estimate.sums.tobytes() == one.estimate.sums.tobytes()
        assert found[number].stats["lookups"] == one.stats["lookups"]
        assert found[number].metadata["digest"] == one.metadata["digest"]


def test_frames_have_the_bits_that_they_have_without_a_cluster(client, expected):
    assert_all(gathered(client), expected)


def test_a_target_error_is_met_by_each_as_on_one_device(client):
    options = {"target_error": 0.1, "sampler": "independent"}
    found = gathered(client, numbers=range(2), **options)
    for number in range(2):
        alone = clvol.render(frame(number), **options)
        assert found[number].image.tobytes() == alone.image.tobytes()
        np.testing.assert_array_equal(found[number].aovs["samples"], alone.aovs["samples"])


def test_a_frame_that_fails_fails_alone(client, expected):
    def broken(number):
        if number == 1:
            raise clvol.VolumeError("is damaged", "smoke.0001.vdb")
        cut = replace(scene().film, crop=(0, 0, 4, 4))
        return frame(number) if number != 3 else replace(frame(number), film=cut)

    found = gathered(client, scene_of=broken, size=(8, 8))
    assert "smoke.0001.vdb: is damaged" in str(found.pop(1))
    failed = found.pop(3)
    assert isinstance(failed, clvol.OptionError) and "worker inproc" in str(failed)
    assert {n: one.image.tobytes() for n, one in found.items()} == {
        n: expected[n].image.tobytes() for n in (0, 2, 4)
    }


def test_what_the_log_says_of_a_frame_is_said_here(client, caplog):
    """Once: the workers of this test share this process, whose own handlers heard it too."""
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sequence, "_tell", told.append)
        with caplog.at_level(logging.WARNING, "clvol"):
            gathered(
                client, numbers=[0], majorant_scale=0.5, technique="weighted-delta", transmittance="ratio"
            )
    assert "above their majorant" in " ".join(str(message) for _, message, _ in told[0])


def test_a_straggler_is_helped_and_comes_once(client, expected, monkeypatch):
    slow, picture = [], whole._picture

    def late(one, urgency):
        if one.scene.seed == COUNT - 1 and not slow:
            slow.append(one)
            on_worker.turn.release()  # the workers of this test share a process, and take turns in it
            while not urgency():
                time.sleep(0.01)
            on_worker.turn.acquire()
        return picture(one, urgency)

    monkeypatch.setattr(whole, "_picture", late)
    monkeypatch.setattr(sequence, "_SHORT_SECONDS", 0.05)
    assert_all(gathered(client), expected)
    assert slow


def test_an_end_gives_up_what_is_under_way(client):
    started = time.monotonic()
    found = gathered(client, lambda: int(time.monotonic() - started > 1), spp=10_000_000, pool=256)
    assert not found
    deadline = time.monotonic() + 30
    while on_worker.turn.locked() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not on_worker.turn.locked(), "the workers are free again"


def test_what_is_done_when_an_end_is_asked_for_comes(client, expected):
    """An end while the first is saved, say: what came meanwhile is not lost."""
    found = {}
    pictures = Pictures(client, {"sampler": "joint"}, frame)
    for number, result in pictures.results(range(COUNT), lambda: len(found)):
        if not found:
            time.sleep(2.0)
        found[number] = result
    assert len(found) > 1
    for number, result in found.items():
        assert result.image.tobytes() == expected[number].image.tobytes()


def test_workers_that_can_render_nothing_end_it_all(client, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(on_worker, "__version__", "0.0.1")
        with pytest.raises(clvol.OptionError, match=r"worker inproc.*: has clvol 0\.0\.1, and .* renders"):
            gathered(client)
    with pytest.raises(clvol.DeviceError, match=r"worker inproc.*: no OpenCL device matches 'no such'"):
        gathered(client, device="no such")
    with monkeypatch.context() as patch:
        patch.setattr(whole, "_picture", lambda *_: 1 / 0)
        found = gathered(client, numbers=[0])
        assert "a worker failed: ZeroDivisionError" in str(found[0])


@pytest.mark.contract
def test_workers_that_are_killed_cost_no_frame_and_no_bit(expected):
    with cluster() as workers, distributed.Client(workers) as client:
        for which in ([0], [0, 1]):
            client.wait_for_workers(2)
            pids = list(client.run(os.getpid).values())
            found = {}
            for number, result in Pictures(client, {"sampler": "joint"}, frame).results(range(COUNT)):
                assert number not in found
                if not found:
                    for one in which:
                        os.kill(pids[one], signal.SIGKILL)
                found[number] = result
            assert_all(found, expected)
