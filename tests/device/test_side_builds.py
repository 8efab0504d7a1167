"""Processes that build kernels: when there are any, what they leave, and that nothing depends on them."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from clvol.device import build_worker, side_builds
from clvol.device.side_builds import Launch, SideBuilds, Unit
from clvol.errors import DeviceError

UNITS = [
    Unit(f"__kernel void k(__global int *a, uint n) {{ a[n] = {n}; }}", (), (Launch("k", 1, 1),))
    for n in range(4)
]
SCRIPT = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import test_side_builds as test
from clvol.device.device import open_device
from clvol.device.side_builds import SideBuilds
print(*getattr(test, sys.argv[2])(open_device(), Path(sys.argv[3])))
"""
"""A user's, without a guard round what it does: processes that import it would render again."""


@pytest.fixture
def pocl(device):
    if not device.is_pocl:
        pytest.skip("the device is not PoCL")
    return device


def run_apart(tmp_path, function):
    """What a function gives in a process with an empty cache of kernels, as text."""
    script, cache = tmp_path / "script.py", tmp_path / "cache"
    script.write_text(SCRIPT)
    command = [sys.executable, script, Path(__file__).parent, function.__name__, cache]
    environment = os.environ | {"POCL_CACHE_DIR": str(cache), side_builds.VARIABLE: "2"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def build_twice(device, cache):
    """Processes that were started, kernels and open pipes that they left, and processes for them again."""
    with SideBuilds(device, UNITS) as builds:
        for unit in UNITS:
            builds.wait(unit.program)
        left = len(list(cache.rglob("*.so")))
        builds.remember()
    pipes = [pipe for process in builds.processes for pipe in (process.stdin, process.stdout)]
    with SideBuilds(device, UNITS) as again:
        return len(builds.processes), left, sum(not pipe.closed for pipe in pipes), len(again.processes)


def test_kernels_are_built_in_processes_once(pocl, tmp_path):
    assert run_apart(tmp_path, build_twice) == ["1", "4", "0", "0"]


@pytest.mark.parametrize("given", ["0", "1"])
def test_the_variable_says_how_many(pocl, monkeypatch, given):
    monkeypatch.setattr(side_builds, "_known", lambda index: set())
    monkeypatch.setenv(side_builds.VARIABLE, given)
    with SideBuilds(pocl, UNITS) as builds:
        assert builds.processes == []


def test_few_kernels_are_not_worth_a_process(pocl, monkeypatch):
    monkeypatch.setattr(side_builds, "_known", lambda index: set())
    monkeypatch.setenv(side_builds.VARIABLE, "2")
    with SideBuilds(pocl, UNITS[: side_builds.WORTH_IT - 1]) as builds:
        assert builds.processes == []


def test_another_driver_is_asked_itself(pocl, monkeypatch):
    monkeypatch.setattr(type(pocl), "is_pocl", False)
    with SideBuilds(pocl, UNITS) as builds:
        assert builds.processes == []
        builds.remember()


def build_wrong(device, cache):
    """What is said of a kernel that does not build, and how many of the others were left."""
    from clvol.device.programs import build

    wrong = Unit("__kernel void k(__global int *a)\n{ a[0] = nowhere; }", (), (Launch("k", 1, 1),))
    with SideBuilds(device, [wrong, *UNITS]) as builds:
        for unit in (wrong, *UNITS):
            builds.wait(unit.program)
        left = len(list(cache.rglob("*.so")))
    try:
        build(device, wrong.source, "k")
    except DeviceError as error:
        return left, "nowhere" in str(error), ":2:" in str(error)
    return ()


def test_the_compilers_message_is_shown(pocl, tmp_path):
    assert run_apart(tmp_path, build_wrong)[1:] == ["True", "True"]


@pytest.fixture
def worker(pocl, tmp_path, monkeypatch):
    """Puts another program in the worker's place."""
    monkeypatch.setattr(side_builds, "_known", lambda index: set())
    monkeypatch.setenv(side_builds.VARIABLE, "2")

    def replace(text):
        (tmp_path / "worker.py").write_text(text)
        monkeypatch.setattr(build_worker, "__file__", str(tmp_path / "worker.py"))

    return replace


@pytest.mark.parametrize("text", ["", "import os; os.abort()", "print(input()); 1 / 0"])
def test_workers_that_end_are_not_waited_for(pocl, worker, text):
    worker(text)
    with SideBuilds(pocl, UNITS) as builds:
        for unit in UNITS:
            builds.wait(unit.program)
    assert len(builds.processes) == 1


def test_ctrl_c_leaves_no_process(pocl, worker, ctrl_c):
    worker("import time; time.sleep(600)")
    processes = []

    def interrupted():
        with SideBuilds(pocl, UNITS) as builds:
            processes.extend(builds.processes)
            threading.Timer(0.1, signal.raise_signal, [signal.SIGINT]).start()
            builds.wait(UNITS[0].program)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [process.returncode for process in processes] == [-signal.SIGKILL]
