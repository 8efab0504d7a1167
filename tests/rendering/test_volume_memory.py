"""Bytes that a dense volume takes: 512³ floats, half a gibibyte, render within two, counted here in small.

What grows with a volume is its samples, the bricks on the device (9³ samples for 8³ cells), and bounds.
PoCL, its compiler and Python's packages take some 250 MiB beside.
"""

import gc
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
    size, share = re.search(
        r"on (\d+) x \1 x \1 points they would fit, (0\.\d+) of these along", said
    ).groups()
    assert float(share) == pytest.approx(int(size) / SIZE, abs=0.006)
    assert float(need) == pytest.approx(BRICKS / 2**20, rel=0.01) and device.description in said
    assert SIZE // 2 < int(size) < SIZE
    opened(device, {"data": noise(int(size))})


def film_scene(width, height):
    film = {"type": "hdrfilm", "width": width, "height": height}
    return {
        "type": "scene",
        "sensor": {"type": "perspective", "film": film},
        "light": {"type": "constant"},
        "ball": {"type": "sphere"},
    }


def test_a_film_of_four_times_the_devices_memory_is_refused_with_what_would_fit(device, monkeypatch):
    """Before anything is allocated or built; and what is said to fit does."""
    gc.collect()
    memory, taken = device.memory, device.memory.taken
    slots = Session.for_scene(
        device, clvol.load_dict(film_scene(4, 4)), Choices(), 1, pool=256
    ).wavefront.bytes
    room = slots + 300 * 200 * 100  # some 400 bytes a pixel, of 300 x 200
    monkeypatch.setattr(memory, "room", lambda: room - (memory.taken - taken))
    monkeypatch.setattr(memory, "limit", taken + room)
    built = len(device.programs)
    with pytest.raises(clvol.DeviceError, match="tiles as crop windows") as caught:
        clvol.render(clvol.load_dict(film_scene(300, 200)), spp=1, pool=256)
    assert memory.taken == taken and len(device.programs) == built
    said = str(caught.value)
    assert "a film of 60000 pixels needs" in said and device.description in said
    width, height = map(int, re.search(r"(\d+) x (\d+) would fit", said).groups())
    assert 75 < width < 250 and height == pytest.approx(width * 2 / 3, abs=1)
    for shape in (film_scene(width, height), film_scene(300, 200)):
        scene = clvol.load_dict(shape)
        if scene.film.width == 300:
            film = {"type": "hdrfilm", "width": 300, "height": 200, "crop_offset_x": 100, "crop_offset_y": 60}
            shape["sensor"]["film"] = film | {"crop_width": width, "crop_height": height}
            scene = clvol.load_dict(shape)
        assert clvol.render(scene, spp=1, pool=256).image.shape == (height, width, 3)


def test_half_a_gibibyte_renders_within_two():
    """The numbers above for 512³: samples, the caller's array, and bricks."""
    samples = 4 * 512**3
    assert 2 * samples + samples * BRICKS / SAMPLES + 250 * 2**20 < 2 << 30
