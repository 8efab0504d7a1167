"""Several devices of one machine share the samples of a picture, whose bits do not depend on it."""

import os
import subprocess
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from every_bit import scene

import clvol
from clvol.cluster.devices import DeviceWorkers
from clvol.device.device import list_devices

SEVERAL = """
import sys
sys.path[:0] = {path!r}
from every_bit import digest, scene
import clvol
from clvol.cluster import ranges
ranges.LEAST_RANGES, ranges.LEAST_PATHS = 16, 1
print(len(clvol.devices()))
for device in ("all", ["pthread"], ["basic"], ["pthread", 0]):
    result = clvol.render(scene(), spp=68, seed=3, sampler="joint", device=device)
    print(digest(result), result.metadata["device"])
"""


@pytest.fixture
def four_ranges(monkeypatch):
    """Pictures are cut into so many only: each has its cost in a test."""
    monkeypatch.setattr("clvol.cluster.ranges.LEAST_RANGES", 4)


def test_a_list_of_devices_has_the_bits_of_merge(four_ranges):
    options = {"seed": 3, "sampler": "joint", "aov": ["depth", "largest_weight"]}
    result = clvol.render(scene(), spp=68, device=[0], **options)
    parts = clvol.merge(
        [clvol.render(scene(), samples=(n, 17), device=0, **options) for n in range(0, 68, 17)]
    )
    whole = clvol.render(scene(), spp=68, device=0, **options)
    assert result.samples == (0, 68) and "samples" not in result.metadata
    for one, other in ((result.image, parts.image), (result.variance, parts.variance)):
        assert one.tobytes() == other.tobytes()
    for name in parts.aovs:
        assert result.aovs[name].tobytes() == parts.aovs[name].tobytes(), name
    np.testing.assert_allclose(result.image, whole.image, rtol=3e-7)
    for name in ("lookups", "paths", "real_collisions", "largest_sample", "uploaded_bytes"):
        assert result.stats[name] == whole.stats[name], name


@pytest.mark.contract
def test_devices_of_one_kind_have_the_same_bits_together_and_alone():
    if "Portable Computing Language" not in list_devices()[0].platform:
        pytest.skip("only PoCL can be told to have several devices on one processor")
    path = [entry for entry in sys.path if entry.endswith("helpers")]
    environment = os.environ | {"POCL_DEVICES": "basic pthread", "CLVOL_DEVICE": ""}
    done = subprocess.run(
        [sys.executable, "-c", SEVERAL.format(path=path)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    count, *lines = done.stdout.splitlines()
    assert done.returncode == 0 and count == "2", done.stderr
    assert len({line.split()[0] for line in lines}) == 1


def lane(workers, number, samples, seconds, running=None):
    one = workers._lanes[number]
    one.samples, one.seconds, one.running = samples, seconds, running


def test_a_slow_device_gets_no_range_that_others_would_be_done_with_sooner():
    workers = DeviceWorkers(None, [SimpleNamespace(), SimpleNamespace()])
    assert workers.room(5) == 2, "nothing is known of their speed"
    lane(workers, 0, 100, 1.0, running=True)
    lane(workers, 1, 10, 1.0)
    assert workers.room(20) == 1
    assert workers.room(5) == 0 and workers.idle()
    lane(workers, 0, 100, 1.0)
    assert workers.room(5) == 1
    workers.close()


def test_a_picture_is_ended_early_and_kept():
    frames = clvol.progressive(scene(), spp=20000, device=[0], interval=0)
    first = next(frames)
    frames.cancel()
    assert 0 < first.samples[1] < 20000 and not first.is_last
    for last in frames:
        assert last.samples[1] < 20000
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("clvol-device")]
    limited = clvol.render(scene(), time_limit=0.01, device=[0])
    assert limited.samples[1] > 0 and np.isfinite(limited.image).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"device": []}, "the list of devices is empty"),
        ({"device": [0, "0"]}, "is listed twice"),
        ({"device": [0, "no such"]}, "no OpenCL device matches 'no such'"),
        ({"device": [0, None, {}]}, "a device is a number or part of a name"),
        ({"device": [0], "profile": True}, "several devices takes no profile"),
        ({"device": [0], "checkpoint": "a.npz"}, "several devices takes no checkpoint"),
        ({"device": [0], "resume": "a.npz"}, "cannot go on from a checkpoint"),
        ({"device": [0], "technique": "auto:pilot"}, "takes no auto:pilot"),
        ({"client": 3}, "3 is no client of Dask's"),
    ],
)
def test_what_cannot_be_shared_is_said(options, message):
    with pytest.raises(clvol.Error, match=message):
        clvol.render(scene(), spp=1, **options)
