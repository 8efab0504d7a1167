"""The workers of a Dask cluster share a picture, whoever does what, and whatever becomes of them."""

import os
import signal
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from dask_clusters import cluster, distributed
from every_bit import scene
from signals import press_key

import clvol
from clvol.cluster import job, link, on_worker
from clvol.rendering import session
from clvol.scene.records import Batch

OPTIONS = {"spp": 40, "seed": 3, "sampler": "joint", "aov": ["depth", "largest_weight"]}
"""Ranges are of one sample each."""


@pytest.fixture(scope="module")
def expected():
    """What one device makes of the same ranges."""
    return clvol.render(scene(), device=[0], **OPTIONS)


def assert_same(one, other):
    assert one.image.tobytes() == other.image.tobytes() and one.variance.tobytes() == other.variance.tobytes()
    assert one.estimate.sums.tobytes() == other.estimate.sums.tobytes()
    assert one.samples == other.samples and one.ranges == other.ranges
    for name in other.aovs:
        assert one.aovs[name].tobytes() == other.aovs[name].tobytes(), name
    for name in ("lookups", "paths", "real_collisions", "largest_sample", "non_finite"):
        assert one.stats[name] == other.stats[name], name


def test_workers_share_a_picture_and_its_bits_are_those_of_one_device(client, expected):
    seen = []
    result = clvol.render(scene(), client=client, progress=seen.append, **OPTIONS)
    assert_same(result, expected)
    assert seen[-1].samples_done == seen[-1].samples_total == 40
    assert seen[-1].noise == result.noise and result.metadata["seconds"] > 0
    further = clvol.render(scene(), client=client, resume=result, **OPTIONS | {"spp": 44})
    assert further.ranges == ((0, 44),)


def test_a_film_larger_than_a_workers_device_is_rendered_in_bands(client, expected, monkeypatch):
    monkeypatch.setattr(session, "rows_at_a_time", lambda memory, plan, size, *_: 3)
    result = clvol.render(scene(), client=client, **OPTIONS)
    assert_same(result, expected)
    assert result.metadata["bands"] == 3 and "bands" not in expected.metadata


def test_sensors_side_by_side_are_in_each_range(client):
    seen = scene()
    several = replace(
        seen, sensor=Batch((seen.sensor, seen.sensor), ("a", "b")), film=replace(seen.film, width=16)
    )
    options = OPTIONS | {"spp": 12}
    result = clvol.render(several, client=client, **options)
    assert_same(result, clvol.render(several, **options))
    assert result.image.shape == (8, 16, 3)


def test_frames_come_while_workers_render_and_an_end_is_kept(client):
    frames = clvol.progressive(scene(), client=client, interval=0, pool=256, **OPTIONS | {"spp": 100_000})
    first = next(frames)
    assert 0 < first.samples[1] < 100_000 and np.isfinite(first.image).all()
    frames.cancel()
    assert all(frame.samples[1] < 100_000 for frame in frames)
    deadline = time.monotonic() + 30  # the scene leaves the device, once what was rendered is through
    while on_worker._ready and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not on_worker._ready


def test_ctrl_c_keeps_the_picture(client, ctrl_c):
    pressed = []

    def press(record):
        if record.samples_done >= 2 * 625 and not pressed:
            pressed.append(record.samples_done)
            press_key(signal.SIGINT)

    options = {"spp": 40_000, "sampler": "independent", "pool": 256}
    result = clvol.render(scene(), client=client, progress=press, **options)
    assert result.stats["interrupted"] and 0 < result.samples[1] < 40_000
    assert sum(count for _, count in result.ranges) == result.samples[1] == result.estimate.count


def test_a_time_limit_ends_ranges_early(client):
    result = clvol.render(scene(), client=client, time_limit=0.05, pool=256)
    assert result.samples[1] > 0 and np.isfinite(result.image).all()


def test_a_job_is_told_of_while_one_of_its_ranges_renders(monkeypatch):
    """A time limit counts from there, whichever thread of a worker comes first."""
    ranges = job.Job(scene(), None, 0, {})
    ready = SimpleNamespace(about=lambda: "ready")
    monkeypatch.setattr(on_worker, "_ready", {ranges.name: ready})
    with on_worker.turn:
        assert on_worker.about(ranges) == "ready"


def test_a_straggler_is_helped_and_counted_once(client, expected, monkeypatch):
    slow, part = [], job.Renderer.part

    def late(renderer, first, count, seed, urgency):
        if first == 20 and not slow:
            slow.append(first)
            on_worker.turn.release()  # the workers of this test share a process, and take turns in it
            while not urgency():
                time.sleep(0.01)
            on_worker.turn.acquire()
        return part(renderer, first, count, seed, urgency)

    monkeypatch.setattr(job.Renderer, "part", late)
    monkeypatch.setattr("clvol.cluster.spread._SHORT_SECONDS", 0.05)
    assert_same(clvol.render(scene(), client=client, **OPTIONS), expected)
    assert slow


def test_faults_on_workers_are_errors_that_say_where(client, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(on_worker, "__version__", "0.0.1")
        with pytest.raises(clvol.OptionError, match=r"worker inproc.*: has clvol 0\.0\.1, and .* renders"):
            clvol.render(scene(), client=client, **OPTIONS)
    with pytest.raises(clvol.DeviceError, match=r"worker inproc.*: no OpenCL device matches 'no such'"):
        clvol.render(scene(), client=client, device="no such", **OPTIONS)
    with monkeypatch.context() as patch:
        patch.setattr(job.Renderer, "part", lambda *_: 1 / 0)
        with pytest.raises(clvol.RenderError, match="a worker failed: ZeroDivisionError"):
            clvol.render(scene(), client=client, **OPTIONS)
    with monkeypatch.context() as patch:
        patch.setattr(job, "Session", None)
        with pytest.raises(clvol.OptionError, match="a worker cannot load clvol"):
            clvol.render(scene(), client=client, **OPTIONS)


def test_clients_that_will_not_do_are_refused(client):
    for name, value in (("profile", True), ("checkpoint", "a.npz"), ("device", "all")):
        with pytest.raises(clvol.OptionError, match=r"cluster takes|each worker of a cluster"):
            clvol.render(scene(), client=client, spp=1, **{name: value})
    closed = distributed.Client(client.cluster)
    closed.close()
    with pytest.raises(clvol.OptionError, match="connection to the cluster is closed"):
        clvol.render(scene(), client=closed, spp=1)


def kill_while_rendering(client, which, expected):
    """Kill workers once five samples are done.

    A cluster that starts no others is waited for, as renders do, but not for ever: the samples are
    too few then.
    """
    pids, done = list(client.run(os.getpid).values()), []

    def kill(record):
        if record.samples_done >= 5 and not done:
            done.append(record.samples_done)
            for number in which:
                os.kill(pids[number], signal.SIGKILL)

    assert_same(clvol.render(scene(), client=client, progress=kill, time_limit=180.0, **OPTIONS), expected)
    assert done


@pytest.mark.contract
def test_a_worker_that_is_killed_costs_no_sample_and_no_bit(expected):
    with cluster() as workers, distributed.Client(workers) as client:
        kill_while_rendering(client, [0], expected)


@pytest.mark.contract
def test_all_workers_may_be_killed_and_with_them_what_they_had_of_the_scene(expected):
    with cluster() as workers, distributed.Client(workers) as client:
        for which in ([0, 1], [1], [0, 1]):
            client.wait_for_workers(2)
            kill_while_rendering(client, which, expected)


def test_a_cluster_without_workers_is_told_of_once_and_anew_when_all_are_gone(monkeypatch, caplog):
    there = []
    client = SimpleNamespace(status="running", nthreads=lambda: there)
    monkeypatch.setattr(link, "check_client", lambda client: client)
    monkeypatch.setattr(link, "_COUNT_SECONDS", -1.0)
    asked = link.Link(client)
    for workers in ([], [], ["a", "b"], ["a"], [], []):
        there[:] = workers
        assert asked.count() == len(workers)
    told = [record.message for record in caplog.records]
    assert [message.split(":")[0] for message in told] == [
        "the cluster has no workers yet",
        "the cluster has no workers any more",
    ]


@pytest.mark.contract
def test_a_target_error_is_met_with_bits_that_a_device_has_too(client):
    options = {"target_error": 0.02, "seed": 5, "sampler": "independent", "pool": 256}
    seen = []
    result = clvol.render(scene(), client=client, progress=seen.append, **options)
    alone = clvol.render(scene(), device=[0], **options)
    assert result.image.tobytes() == alone.image.tobytes() and result.samples == alone.samples
    assert result.noise < 1.1 * 0.02 and result.metadata["target_error"] == 0.02
    assert [record.what for record in seen[:1]] == ["survey"] and seen[-1].what == "rendering"
    few = clvol.render(scene(), device=[0], spp=24, **options)
    assert few.samples[1] == 24
