"""Renders at once and one after the other: in threads, in processes, hundreds in one process."""

import gc
import multiprocessing
import os
import subprocess
import sys
import threading
from pathlib import Path

import pyopencl as cl
import pytest
from every_bit import digest, rendered, scene
from pictures import box, homogeneous, picture

import clvol
from clvol.device.device import open_device
from clvol.scene.records import ConstantEmitter

SPP, SEEDS = 16, range(3)


def bits(seed, described=None):
    return digest(rendered(described or scene(), spp=SPP, seed=seed))


@pytest.fixture(scope="module")
def alone():
    """What each seed has where nothing else renders."""
    return {seed: bits(seed) for seed in SEEDS}


@pytest.mark.parametrize("shares", [False, True])
def test_threads_render_at_once(alone, shares):
    """Scenes of their own, or one that they share."""
    shared, found = scene() if shares else None, []
    threads = [
        threading.Thread(target=lambda seed=seed: found.append((seed, bits(seed, shared)))) for seed in SEEDS
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert dict(found) == alone


def test_threads_build_the_same_kernels_at_once(alone):
    open_device().programs.clear()
    test_threads_render_at_once(alone, True)


@pytest.mark.contract
def test_processes_that_are_spawned_render(alone):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert dict(zip(SEEDS, pool.map(bits, SEEDS), strict=True)) == alone


def state():
    """What a process may take more and more of: bytes on the device, files, threads, contexts, objects."""
    gc.collect()
    device = open_device()
    held = device.context.get_info(cl.context_info.REFERENCE_COUNT)
    files, threads = (len(list(Path("/proc/self", what).iterdir())) for what in ("fd", "task"))
    return (device.memory.taken, files, threads, held), len(gc.get_objects())


def resident():
    """Pages of memory."""
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.contract
def test_sixty_renders_leave_nothing_behind():
    def render():
        fog = box((0, 0, 0), (1, 1, 1), homogeneous(1.0, 0.5))
        described = picture([fog], [ConstantEmitter()], (0.5, 0.5, -2), (0.5, 0.5, 0), size=(4, 4))
        clvol.render(described, spp=2, pool=64)

    for _ in range(10):
        render()
    before, pages = state(), resident()
    for _ in range(60):
        render()
    after = state()
    assert after[0] == before[0]
    assert after[1] - before[1] < 600, "objects of Python: fewer than ten a render"
    assert (resident() - pages) * os.sysconf("SC_PAGE_SIZE") < 60 << 16, "less than 64 KiB a render"


@pytest.mark.contract
def test_renders_that_start_together_share_an_empty_cache(tmp_path):
    code = """
import clvol
film = {"type": "hdrfilm", "width": 4, "height": 4}
sensor = {"type": "perspective", "film": film}
scene = clvol.load_dict({"type": "scene", "sky": {"type": "constant"}, "sensor": sensor})
print(clvol.render(scene, spp=3, seed=1).image.tobytes().hex())
"""
    environment = os.environ | {"POCL_CACHE_DIR": str(tmp_path / "cache")}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": environment}
    processes = [subprocess.Popen([sys.executable, "-c", code], **pipes) for _ in range(2)]
    said = [process.communicate(timeout=300) for process in processes]
    assert [process.returncode for process in processes] == [0, 0], said
    assert len({text for text, _ in said}) == 1
    assert not any(errors for _, errors in said)
