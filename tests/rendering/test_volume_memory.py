"""Bytes that a dense volume takes: 512³ floats, half a gibibyte, render within two, counted here in small.

What grows with a volume is its samples, the bricks on the device (9³ samples for 8³ cells), and bounds.
PoCL, its compiler and Python's packages take some 250 MiB beside.
"""

import re
import tracemalloc

import numpy as np
import pytest

import clvol
from clvol.layout import BRICK_CELLS, BRICK_EDGE, BRICK_SAMPLES
from clvol.planning.choices import Choices
from clvol.rendering.session import Session
from clvol.volumes.vol import write_vol

SIZE = 96
SAMPLES = 4 * SIZE**3
BRICKS = 4 * BRICK_SAMPLES * (SIZE // BRICK_CELLS) ** 3
LAYER = 4 * SIZE**2 * BRICK_EDGE
BOUNDS = SAMPLES // 8
"""Extrema of half bricks, with and without slack, and the coarser lattices that are weighed."""
FILE = SAMPLES + 5 * LAYER + BOUNDS
"""On the host, of a volume from a file: its samples, and some layers of bricks on their way to the device."""
FROM_ARRAY = FILE + SAMPLES
"""The caller may write to an array: it is copied."""


def opened(device, volume):
    """A session on a film of 16 pixels.

    No kd-tree is weighed: it has so many leaves at most, and takes as much for any volume.
    """
    scene = clvol.load_dict(
        {
            "type": "scene",
            "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
            "light": {"type": "constant"},
            "cube": {
                "type": "cube",
                "bsdf": {"type": "null"},
                "interior": {"type": "heterogeneous", "sigma_t": {"type": "gridvolume", **volume}},
            },
        }
    )
    return Session.for_scene(device, scene, Choices(majorant="grid"), seed=1, pool=256)


def noise(size):
    """A field that varies in every brick: the worst case."""
    return np.random.default_rng(1).random((size, size, size), np.float32)


@pytest.mark.parametrize(("kind", "most"), [("npy", FILE), ("vol", FILE), ("array", FROM_ARRAY)])
def test_a_dense_volume_is_there_once_on_the_host_and_once_on_the_device(device, tmp_path, kind, most):
    opened(device, {"data": noise(8)})  # kernels are composed and built
    values, given = noise(SIZE), 0
    if kind == "npy":
        np.save(tmp_path / "volume.npy", values)
    elif kind == "vol":
        write_vol(tmp_path / "volume.vol", values, [[0, 0, 0], [1, 1, 1]])
    else:
        given = values.nbytes
    volume = {"data": values} if given else {"filename": str(tmp_path / f"volume.{kind}")}
    before = device.memory.taken
    tracemalloc.start()
    try:
        session = opened(device, volume)
        peak = given + tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < most
    assert BRICKS < device.memory.taken - before < BRICKS + BOUNDS
    assert session.prepared.volumes[0].bricks.brick_count == BRICKS // (4 * BRICK_SAMPLES)


def test_a_volume_of_four_times_the_devices_memory_is_refused_with_what_would_fit(device, monkeypatch):
    """Before anything is allocated; and what is said to fit does."""
    beside = opened(device, {"data": noise(8)}).wavefront.bytes + 2**16  # the render's, and a cube's
    memory = device.memory
    taken = memory.taken

    def limited(room):
        monkeypatch.setattr(memory, "room", lambda: room - (memory.taken - taken))
        monkeypatch.setattr(memory, "limit", taken + room)

    limited(beside + BRICKS // 4)
    with pytest.raises(clvol.DeviceError, match="and all of them must be there") as caught:
        opened(device, {"data": noise(SIZE)})
    assert memory.taken == taken
    said = str(caught.value)
    need = re.search(r"need ([\d.]+) MiB", said)[1]
    size = re.search(r"on (\d+) x \1 x \1 points", said)[1]
    assert float(need) == pytest.approx(BRICKS / 2**20, rel=0.01) and device.description in said
    assert SIZE // 2 < int(size) < SIZE
    opened(device, {"data": noise(int(size))})


def test_half_a_gibibyte_renders_within_two():
    """The numbers above for 512³: samples, the caller's array, and bricks."""
    samples = 4 * 512**3
    assert 2 * samples + samples * BRICKS / SAMPLES + 250 * 2**20 < 2 << 30
