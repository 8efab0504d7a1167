"""PoCL's cache of kernels: damaged files, folders that cannot be written, a linker that does not run."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tiers import quick_first

import clvol
from clvol.device import kernel_cache
from clvol.device.device import open_device
from clvol.device.kernel_cache import STAMP, KernelFolder, is_whole, remove_broken, unusable
from clvol.errors import DeviceError

SCENE = """<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">
<integer name="width" value="4"/><integer name="height" value="4"/></film></sensor>
<emitter type="constant"/></scene>"""


def render(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """A small render in a process of its own; an empty value removes the variable."""
    scene = folder / "scene.xml"
    scene.write_text(SCENE)
    variables = {k: v for k, v in (os.environ | environment).items() if v}
    command = [sys.executable, "-m", "clvol", "render", str(scene), "-o", str(folder / "o.exr"), "--quiet"]
    return subprocess.run(
        [*command, "--spp", "1"], env=variables, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache with the kernels of one render."""
    if "Portable Computing Language" not in open_device().info.platform:
        pytest.skip("the device is not PoCL")
    folder = tmp_path_factory.mktemp("built")
    done = render(folder, POCL_CACHE_DIR=str(folder / "cache"))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return folder / "cache"


def empty(data: bytes) -> bytes:
    return b""


def half(data: bytes) -> bytes:
    return data[: len(data) // 2]


def almost(data: bytes) -> bytes:
    return data[:-8]


def zeros(data: bytes) -> bytes:
    return bytes(len(data))


def zeros_at_the_end(data: bytes) -> bytes:
    return data[:-4096] + bytes(4096)


CUTS = [empty, half, almost, zeros, zeros_at_the_end]


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("kind", ["*.so", "program.bc"])
def test_a_file_cut_short_is_told_from_a_whole_one(built, tmp_path, kind, cut):
    for file in sorted(built.rglob(kind)):
        copy = tmp_path / file.name
        copy.write_bytes(file.read_bytes())
        assert is_whole(str(copy))
        copy.write_bytes(cut(file.read_bytes()))
        assert not is_whole(str(copy))


@quick_first(("kind", "cut"), [("generate_kernel.so", empty), ("program.bc", half)])
def test_a_cache_file_cut_short_is_built_anew(built, tmp_path, kind, cut):
    """Loaded unchecked, either ends the process with SIGABRT, in every later render."""
    cache = tmp_path / "cache"
    shutil.copytree(built, cache)
    for file in cache.rglob(kind):
        file.write_bytes(cut(file.read_bytes()))
    (cache / STAMP).write_text("the machine was started since")
    first = render(tmp_path, POCL_CACHE_DIR=str(cache))
    assert (first.returncode, first.stderr.count("cut short")) == (0, 1), first.stderr
    assert all(is_whole(str(file)) for file in cache.rglob("*.so"))


def test_programs_are_looked_at_once_since_the_machine_was_started(built, tmp_path, monkeypatch):
    """A cache of thousands takes seconds."""
    cache, looked_at = tmp_path / "cache", []
    shutil.copytree(built, cache)
    monkeypatch.setattr(kernel_cache, "is_whole", lambda path: not looked_at.append(path))
    (cache / STAMP).unlink()
    assert remove_broken(cache) == 0
    count = len(looked_at)
    assert count >= 2 * len(list(cache.rglob("program.bc"))) > 0
    os.utime(cache / STAMP, (time.time() + 60,) * 2)  # after everything in it
    assert remove_broken(cache) == 0
    assert len(looked_at) == count
    new = next(cache.rglob("program.bc")).parent
    shutil.copytree(new, new.with_name("A" * 36))
    later = time.time() + 90
    for folder in (new.parent, new.with_name("A" * 36)):
        os.utime(folder, (later, later))
    assert remove_broken(cache) == 0
    assert {Path(path).name for path in looked_at[count:]} == {f.name for f in new.rglob("*.[bs][co]")}
    monkeypatch.setattr(kernel_cache, "_boot", lambda: "")
    assert remove_broken(cache) == 0
    assert len(looked_at) > 2 * count, "a system that does not tell when it was started"


def test_only_programs_are_looked_at(built, tmp_path):
    """Whatever else lies in a folder that somebody calls PoCL's cache stays there."""
    other = tmp_path / "AB" / "notes" / "x.so"
    other.parent.mkdir(parents=True)
    other.write_bytes(b"")
    (tmp_path / "y.bc").write_bytes(b"")
    assert remove_broken(tmp_path) == 0
    assert other.exists()
    assert remove_broken(built) == 0


def test_without_a_home_kernels_go_to_a_temporary_folder(built, tmp_path):
    """Service accounts have none: PoCL then finds no device, and pyopencl fails at the first kernel."""
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    done = render(tmp_path, HOME="/proc/none", XDG_CACHE_HOME="", POCL_CACHE_DIR="", TMPDIR=str(temporary))
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("built anew each time") == 1
    assert "Traceback" not in done.stderr
    assert list(temporary.iterdir()) == []


def test_a_damaged_cache_of_pyopencl_is_left_aside(built, tmp_path):
    """An sqlite file that every process opens with its first kernel."""
    home = tmp_path / "home"
    first = render(tmp_path, XDG_CACHE_HOME=str(home), POCL_CACHE_DIR=str(built))
    assert first.returncode == 0, first.stderr
    databases = list(home.rglob("*.sqlite"))
    assert databases
    for file in databases:
        file.write_bytes(b"not a database" * 1000)
    done = render(tmp_path, XDG_CACHE_HOME=str(home), POCL_CACHE_DIR=str(built))
    assert (done.returncode, done.stderr) == (0, "")


def test_no_folder_at_all_is_an_error_that_says_why(monkeypatch):
    monkeypatch.setattr(kernel_cache, "ROOM", 1 << 62)
    assert "MiB free" in unusable(Path("."))
    with pytest.raises(DeviceError, match="no folder for the kernels it builds: one; two; let the variable"):
        kernel_cache.check(KernelFolder(None, "one; two"))


def test_a_folder_that_is_a_file_cannot_be_used(tmp_path):
    (tmp_path / "file").write_text("")
    assert "cannot be written (" in unusable(tmp_path / "file")
    assert "cannot be written (" in unusable(tmp_path / "file" / "below")


def test_a_linker_that_fails_is_an_error(built, tmp_path):
    """PoCL calls it when it builds, and aborts."""
    linker = tmp_path / "bin" / "ld"
    linker.parent.mkdir()
    linker.write_text("#!/bin/sh\nexit 1\n")
    linker.chmod(0o755)
    path = f"{linker.parent}{os.pathsep}{os.environ['PATH']}"
    done = render(tmp_path, PATH=path, POCL_CACHE_DIR=str(built))
    assert done.returncode == 2
    assert "`ld`" in done.stderr and "does not run" in done.stderr


def test_kernels_are_built_without_a_path(built, tmp_path):
    """PoCL finds the linker by PATH alone, where Python falls back to the system's folders."""
    done = render(tmp_path, PATH="", POCL_CACHE_DIR=str(tmp_path / "cache"))
    assert done.returncode == 0, done.stderr


def test_the_error_of_a_driver_is_shown(monkeypatch):
    import pyopencl as cl

    code = cl.status_code.OUT_OF_HOST_MEMORY

    class Platform:
        name = "Some vendor's OpenCL"

        def get_devices(self):
            raise cl.RuntimeError(cl._cl._ErrorRecord("no luck", code, "clGetDeviceIDs"))

    monkeypatch.setattr(cl, "get_platforms", lambda: [Platform()])
    with pytest.raises(DeviceError, match=r"Some vendor's OpenCL: .*OUT_OF_HOST_MEMORY"):
        clvol.render(clvol.load_dict({"type": "scene", "sensor": {"type": "perspective"}}))
