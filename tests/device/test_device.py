"""Devices: processes forked after a render, and memory that is counted before it is used."""

import gc
import multiprocessing
import subprocess
import sys

import pytest
from pictures import box, homogeneous, picture

import clvol
from clvol.base.memory import _free_of_group
from clvol.device import memory as device_memory
from clvol.device.device import open_device
from clvol.device.memory import DeviceMemory
from clvol.errors import DeviceError
from clvol.scene.records import ConstantEmitter


def scene():
    return picture(
        [box((0, 0, 0), (1, 1, 1), homogeneous(1.0, 0.5))], [ConstantEmitter()], (0.5, 0.5, -2), (0.5, 0.5, 0)
    )


def _render_in_child(answers):
    try:
        clvol.render(scene(), spp=1)
        answers.put("rendered")
    except clvol.Error as error:
        answers.put(str(error))


def test_a_process_forked_after_a_render_is_refused(device):
    """The driver's threads stay in the parent: the child would wait for them for ever."""
    clvol.render(scene(), spp=1)
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=_render_in_child, args=(answers,), daemon=True)
    child.start()
    assert "forked" in answers.get(timeout=60)
    child.join(60)
    assert child.exitcode == 0
    clvol.render(scene(), spp=1)  # the parent goes on


def test_a_process_forked_before_any_render_renders():
    """Importing clvol starts nothing."""
    code = """
import os, sys
import clvol
child = os.fork()
if not child:
    film = {"type": "hdrfilm", "width": 2, "height": 2}
    sensor = {"type": "perspective", "film": film}
    clvol.render(clvol.load_dict({"type": "scene", "light": {"type": "constant"}, "sensor": sensor}), spp=1)
    os._exit(7)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    done = subprocess.run([sys.executable, "-c", code], timeout=120, capture_output=True, text=True)
    assert done.returncode == 7, done.stderr


@pytest.fixture
def memory(device, monkeypatch):
    """A device that works in a machine with 64 MiB free."""
    monkeypatch.setattr(device_memory, "available_memory", lambda: 64 << 20)
    return DeviceMemory(device.context, "a device", total=1 << 40, largest=48 << 20, shared=True)


def test_buffers_are_refused_when_all_of_them_are_too_many(memory):
    """Drivers hand out more than there is, and the process dies at the first launch that writes there."""
    first = memory.allocate(40 << 20, "a film", "")
    with pytest.raises(DeviceError, match="a volume needs 30 MiB beside 40 MiB in use; a device has 60 MiB"):
        memory.allocate(30 << 20, "a volume", "")
    memory.allocate(20 << 20, "a volume", "")
    del first
    assert memory.taken == 0
    memory.allocate(30 << 20, "a volume", "")


def test_a_buffer_beyond_the_devices_largest_is_refused(memory):
    with pytest.raises(DeviceError, match="a film needs a buffer of 50 MiB, where 48 MiB are allowed"):
        memory.allocate(50 << 20, "a film", "")


def test_a_picture_without_room_is_refused_before_the_first_launch(monkeypatch):
    device = open_device()
    if not device.memory.shared:
        pytest.skip("the device has memory of its own")
    monkeypatch.setattr(device_memory, "available_memory", lambda: 200 << 20)
    monkeypatch.setattr(device.memory, "limit", device.memory.taken + (200 << 20))  # where tests left buffers
    big = picture([], [ConstantEmitter()], (0, 0, -2), (0, 0, 0), size=(1200, 1000))
    with pytest.raises(DeviceError, match=r"a film of 1200000 pixels needs .* x .* would fit"):
        clvol.render(big, spp=1)


def test_a_render_gives_its_buffers_back(device):
    gc.collect()
    before = device.memory.taken
    clvol.render(scene(), spp=1)
    gc.collect()
    assert device.memory.taken == before


def test_free_memory_heeds_control_groups(tmp_path):
    def write(folder, **files):
        for name, text in files.items():
            path = tmp_path / folder / name.replace("__", ".")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def free(folder):
        return _free_of_group(tmp_path / folder)

    write("two", memory__max="1000\n", memory__current="900\n", memory__stat="inactive_file 300\n")
    write("none", memory__max="max\n", memory__current="900\n")
    write("one/memory", memory__limit_in_bytes="1000\n", memory__usage_in_bytes="900\n")
    write("full", memory__max="1000\n", memory__current="1100\n")
    assert (free("two"), free("none"), free("one"), free("full")) == (400, None, 100, 0)


def test_free_memory_of_this_machine_is_known():
    assert device_memory.available_memory() > 1 << 20
