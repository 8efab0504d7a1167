"""A device that runs out of memory or is lost: an error that says so, and nothing that was done is gone."""

import tempfile

import numpy as np
import pyopencl as cl
import pytest
from every_bit import scene

import clvol
from clvol.device import programs
from clvol.device.device import open_device

CODES = {
    "MEM_OBJECT_ALLOCATION_FAILURE": "ran out of memory",
    "OUT_OF_RESOURCES": "ran out of memory, or a kernel ran for longer",
    "DEVICE_NOT_AVAILABLE": "was lost",
    "INVALID_OPERATION": "failed",
}


def failure(code: str, kind: type[cl.Error] = cl.RuntimeError) -> cl.Error:
    return kind(cl._cl._ErrorRecord("clSomething", getattr(cl.status_code, code), ""))


@pytest.fixture
def fails(monkeypatch):
    """Have calls of pyopencl fail, the first `after` of which work."""

    def arrange(name: str, code: str, after: int = 0, kind: type[cl.Error] = cl.RuntimeError) -> None:
        works, calls = getattr(cl, name), []

        def call(*given, **options):
            calls.append(name)
            if len(calls) > after:
                raise failure(code, kind)
            return works(*given, **options)

        monkeypatch.setattr(cl, name, call)

    return arrange


@pytest.fixture
def spare(tmp_path, monkeypatch):
    """The folder for temporary files."""
    folder = tmp_path / "spare"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


CALLS = ["enqueue_nd_range_kernel", "enqueue_copy", "enqueue_fill_buffer", "Kernel"]


@pytest.mark.parametrize(("name", "code"), list(zip(CALLS, CODES, strict=True)))
def test_what_a_driver_says_is_an_error_that_says_what_to_do(fails, spare, name, code):
    clvol.render(scene(), spp=1)
    for after in (0, 7):
        fails(name, code, after, cl.MemoryError if code.startswith("MEM") else cl.RuntimeError)
        with pytest.raises(clvol.DeviceError, match=f"{CODES[code]}.*{code} in clSomething") as caught:
            clvol.render(scene(), spp=400)
        assert caught.value.hint


def test_other_commands_say_it_too(fails):
    fails("enqueue_nd_range_kernel", "OUT_OF_RESOURCES")
    with pytest.raises(clvol.DeviceError, match="OUT_OF_RESOURCES"):
        clvol.trace_ray(scene(), 1, 1)
    with pytest.raises(clvol.DeviceError, match="OUT_OF_RESOURCES"):
        clvol.render(scene(), target_error=0.1, spp=64)
    with pytest.raises(clvol.DeviceError, match="OUT_OF_RESOURCES"):
        clvol.compare(scene(), techniques=["delta", "regular"], spp=1)


def fail_once_there_are(monkeypatch, samples: int, lost: bool = False):
    """Let launches fail once a picture has so many samples; of a lost device copies, too."""
    works = {name: getattr(cl, name) for name in ("enqueue_nd_range_kernel", "enqueue_copy")}
    done = []

    def tell(record) -> None:
        done.append(record.samples_done)

    def call(name):
        def called(*given, **options):
            if done and done[-1] >= samples and (lost or name.endswith("kernel")):
                raise failure("DEVICE_NOT_AVAILABLE" if lost else "OUT_OF_RESOURCES")
            return works[name](*given, **options)

        return called

    for name in works:
        monkeypatch.setattr(cl, name, call(name))
    return tell


OPTIONS = {"spp": 200, "seed": 3, "pool": 64}


def test_the_samples_of_a_device_that_fails_are_kept_as_a_picture(monkeypatch, spare):
    with monkeypatch.context() as patch:
        tell = fail_once_there_are(patch, 2)
        with pytest.raises(clvol.DeviceError, match="resume goes on from it") as caught:
            clvol.render(scene(), progress=tell, **OPTIONS)
    [kept] = spare.iterdir()
    assert str(kept) in str(caught.value)
    more = clvol.render(scene(), resume=kept, **OPTIONS)
    whole = clvol.render(scene(), **OPTIONS)
    np.testing.assert_allclose(more.image, whole.image, rtol=1e-5)


def test_the_samples_of_a_device_that_fails_are_in_the_checkpoint(monkeypatch, spare, tmp_path):
    path = tmp_path / "a.npz"
    with monkeypatch.context() as patch:
        tell = fail_once_there_are(patch, 2)
        with pytest.raises(clvol.DeviceError, match=r"a\.npz has \d+ samples of each pixel") as caught:
            clvol.render(scene(), progress=tell, checkpoint=path, **OPTIONS)
    assert not list(spare.iterdir()) and "ran out of memory" in str(caught.value)
    more = clvol.render(scene(), resume=path, **OPTIONS)
    assert more.image.tobytes() == clvol.render(scene(), **OPTIONS).image.tobytes()


def test_a_device_that_is_lost_leaves_the_last_checkpoint(monkeypatch, spare, tmp_path):
    path = tmp_path / "a.npz"
    clvol.render(scene(), **OPTIONS | {"spp": 5}, checkpoint=path)
    with monkeypatch.context() as patch:
        tell = fail_once_there_are(patch, 6, lost=True)
        with pytest.raises(clvol.DeviceError, match=r"was lost.* has 5 samples of each pixel"):
            clvol.render(scene(), progress=tell, checkpoint=path, **OPTIONS)
        with pytest.raises(clvol.DeviceError, match="was lost") as caught:
            clvol.render(scene(), progress=tell, **OPTIONS)
    assert not list(spare.iterdir()) and "resume" not in str(caught.value)


@pytest.mark.parametrize("kind", [cl.RuntimeError, cl.LogicError, cl.MemoryError])
def test_a_kernel_that_does_not_build_is_an_error_with_the_log(monkeypatch, kind):
    with pytest.raises(clvol.DeviceError, match=r"(?s)kernel 'k' does not build on .*error"):
        programs.build(open_device(), "__kernel void k() { nonsense }", "k")

    class Unbuilt:
        def __init__(self, *_):
            pass

        def build(self, **_):
            raise failure("OUT_OF_HOST_MEMORY", kind)

        def get_build_info(self, *_):
            raise failure("INVALID_DEVICE")

    monkeypatch.setattr(cl, "Program", Unbuilt)
    with pytest.raises(clvol.DeviceError, match=r"(?s)does not build.*OUT_OF_HOST_MEMORY"):
        programs.build(open_device(), "never built", "k")
